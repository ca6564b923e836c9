#include "config/document.h"

#include <toml++/toml.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <numeric>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include "physics/sensor_chain.h"

namespace stickslip::config {

namespace {

constexpr std::uintmax_t largest_file = 1U << 20U;
constexpr std::size_t most_units = 64;
constexpr std::size_t most_registers = 256;
constexpr std::size_t most_faults = 256;  // each is looked at in every cycle

struct Place {
  int line = 0;
  int column = 0;
};

Place place_of(const toml::source_region& region) {
  return {static_cast<int>(region.begin.line), static_cast<int>(region.begin.column)};
}

std::string joined(std::string_view prefix, std::string_view name) {
  std::string path(prefix);
  if (!path.empty()) path += '.';
  return path += name;
}

std::string_view parent_of(std::string_view path) {
  const auto dot = path.rfind('.');
  return dot == std::string_view::npos ? std::string_view{} : path.substr(0, dot);
}

std::string_view name_in(std::string_view path) {
  const auto dot = path.rfind('.');
  return dot == std::string_view::npos ? path : path.substr(dot + 1);
}

/// A problem is one line, whatever the file holds.
std::string one_line(std::string_view text) {
  std::string out;
  for (char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte == '\n') {
      out += "\\n";
    } else if (byte == '\t') {
      out += "\\t";
    } else if (byte < 0x20 || byte == 0x7f) {
      out += '?';
    } else {
      out += c;
    }
  }
  return out;
}

/// A value as a message shows it.
std::string found_text(const toml::node& node) {
  if (node.is_table()) return "a table";
  if (node.is_array()) return "a list";
  std::string out;
  node.visit([&out](const auto& value) {
    using Node = decltype(value);
    if constexpr (toml::is_string<Node>) {
      out = '"' + *value + '"';
    } else if constexpr (toml::is_floating_point<Node>) {
      out = number_text(*value);
    } else if constexpr (toml::is_value<Node>) {
      std::ostringstream text;
      text << value;
      out = text.str();
    }
  });
  constexpr std::size_t longest = 60;
  if (out.size() > longest) {
    // Not in the middle of a UTF-8 character.
    std::size_t end = longest;
    while (end > 0 && (static_cast<unsigned char>(out[end]) & 0xC0U) == 0x80U) --end;
    out = out.substr(0, end) + "...";
  }
  return out;
}

/// How many letters must be put in, left out, changed or swapped with a neighbour.
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1);
  std::vector<std::size_t> above(b.size() + 1);
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(above.begin(), above.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] =
          std::min({above[j] + 1, row[j - 1] + 1, above[j - 1] + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        row[j] = std::min(row[j], before[j - 2] + 1);
      }
    }
    std::swap(before, above);
    std::swap(above, row);
  }
  return above[b.size()];
}

}  // namespace

std::string nearest(std::string_view name, const std::vector<std::string>& names) {
  constexpr std::size_t longest_name = 64;
  if (name.size() > longest_name) return {};
  // One that lacks its unit only.
  for (const std::string& each : names) {
    if (name.size() >= 2 && each.starts_with(std::string(name) + '_')) return each;
  }
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, name.size() / 3) + 1;
  for (const std::string& each : names) {
    const std::size_t d = distance(name, each);
    if (d < best_distance && d < each.size()) {
      best = each;
      best_distance = d;
    }
  }
  // One that differs by its ending only has another unit, or none.
  if (best.empty() && name.size() >= 3) {
    for (const std::string& each : names) {
      if (each.starts_with(name) || name.starts_with(each)) return each;
    }
  }
  return best;
}

namespace {

/// The names that may stand in the table `prefix`, in the order of the keys.
std::vector<std::string> names_within(std::span<const Key> keys, std::string_view prefix) {
  std::vector<std::string> names;
  const auto add = [&names](std::string name) {
    if (std::find(names.begin(), names.end(), name) == names.end())
      names.push_back(std::move(name));
  };
  for (const Key& key : keys) {
    for (Channel channel : all_channels) {
      std::string path(key.path);
      const auto star = path.find('*');
      if (star != std::string::npos) path.replace(star, 1, info(channel).stem);
      if (prefix.empty()) {
        add(path.substr(0, path.find('.')));
      } else if (path.size() > prefix.size() && path.starts_with(prefix) &&
                 path[prefix.size()] == '.') {
        const std::string rest = path.substr(prefix.size() + 1);
        add(rest.substr(0, rest.find('.')));
      }
      if (star == std::string::npos) break;
    }
  }
  return names;
}

bool is_table_of(std::span<const Key> keys, std::string_view path) {
  return !names_within(keys, path).empty();
}

std::string listed(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

const toml::node* element_at(const toml::array& list, std::string_view number) {
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), index);
  const bool all = error == std::errc{} && end == number.data() + number.size();
  return all ? list.get(index) : nullptr;
}

/// The node at a path of tables, and of numbers within lists, or null.
const toml::node* node_at(const toml::table& root, std::string_view path) {
  const toml::node* node = &root;
  while (true) {
    const auto dot = path.find('.');
    const std::string_view name = path.substr(0, dot);
    if (const toml::table* table = node->as_table()) {
      node = table->get(name);
    } else if (const toml::array* list = node->as_array()) {
      node = element_at(*list, name);
    } else {
      return nullptr;
    }
    if (node == nullptr || dot == std::string_view::npos) return node;
    path = path.substr(dot + 1);
  }
}

/// A number of the file, whole or not; nothing where the node is none.
std::optional<double> number_in(const toml::node* node) {
  if (node == nullptr || !node->is_number()) return std::nullopt;
  return node->value<double>();
}

physics::Parameter parameter_in(const toml::node& node) {
  if (const toml::table* table = node.as_table()) {
    return {number_in(table->get("value")).value_or(0.0),
            number_in(table->get("sigma")).value_or(0.0)};
  }
  return {number_in(&node).value_or(0.0), 0.0};
}

std::optional<std::size_t> choice_in(const toml::node* node, const Key& key) {
  const auto text = node != nullptr ? node->value_exact<std::string_view>() : std::nullopt;
  if (!text) return std::nullopt;
  const auto choices = choices_of(key.choices);
  const auto at = std::find(choices.begin(), choices.end(), *text);
  if (at == choices.end()) return std::nullopt;
  return static_cast<std::size_t>(at - choices.begin());
}

/// How messages call a [[fault]] table: fault.noise.
std::string fault_label(const toml::table& fault) {
  const auto choice = choice_in(fault.get("kind"), *find_key(fault_keys(), "kind"));
  return choice ? joined("fault", choice_at(fault_keys(), "kind", *choice)) : "fault";
}

std::optional<std::array<double, 2>> pair_in(const toml::node* node) {
  const toml::array* list = node != nullptr ? node->as_array() : nullptr;
  if (list == nullptr || list->size() != 2) return std::nullopt;
  const auto first = number_in(list->get(0));
  const auto second = number_in(list->get(1));
  if (!first || !second || !std::isfinite(*first) || !std::isfinite(*second)) return std::nullopt;
  return std::array{*first, *second};
}

std::optional<LineCovariance> covariance_in(const toml::node* node) {
  const toml::array* list = node != nullptr ? node->as_array() : nullptr;
  if (list == nullptr || list->size() != 3) return std::nullopt;
  std::array<double, 3> out{};
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto number = number_in(list->get(i));
    if (!number || !std::isfinite(*number)) return std::nullopt;
    out[i] = *number;
  }
  return LineCovariance{out[0], out[1], out[2]};
}

std::string text_in(const toml::table& table, std::string_view name) {
  return table[name].value_or(std::string());
}

CalibrationPoint point_in(const toml::table& table) {
  return {number_in(table.get("raw")).value_or(0.0), number_in(table.get("raw_std")).value_or(0.0),
          number_in(table.get("reference_si")).value_or(0.0),
          number_in(table.get("reference_sigma")).value_or(0.0)};
}

ChannelCalibration calibration_in(const toml::table& table) {
  ChannelCalibration out;
  out.offset = number_in(table.get("offset")).value_or(out.offset);
  out.gain = number_in(table.get("gain")).value_or(out.gain);
  if (const toml::table* leaks = table["crosstalk"].as_table()) {
    for (Channel channel : all_channels) {
      out.crosstalk[index_of(channel)] = number_in(leaks->get(info(channel).stem)).value_or(0.0);
    }
  }
  out.covariance = covariance_in(table.get("covariance")).value_or(LineCovariance{});
  out.residual_std = number_in(table.get("residual_std")).value_or(0.0);
  if (const auto range = pair_in(table.get("valid_range"))) {
    out.valid = ValidRange{(*range)[0], (*range)[1]};
  }
  out.raw_unit = text_in(table, "raw_unit");
  out.date = text_in(table, "date");
  out.reference = text_in(table, "reference");
  out.by = text_in(table, "by");
  if (const toml::array* list = table["despite"].as_array()) {
    for (const toml::node& each : *list) out.despite.push_back(each.value_or(std::string()));
  }
  if (const toml::array* list = table["point"].as_array()) {
    for (const toml::node& each : *list) out.points.push_back(point_in(*each.as_table()));
  }
  return out;
}

/// A node as TOML writes it on one line. `whole`: whole numbers stay what they are; else 2 and 2.0
/// are one number, 2.0.
std::string toml_text(const toml::node& node, bool whole) {
  std::string out;
  if (const toml::table* table = node.as_table()) {
    for (const auto& [name, inner] : *table) {
      out += (out.empty() ? "{ " : ", ") + std::string(name.str()) + " = " +
             toml_text(inner, whole || name.str() == "order");
    }
    return out.empty() ? "{}" : out + " }";
  }
  if (const toml::array* list = node.as_array()) {
    for (const toml::node& inner : *list)
      out += (out.empty() ? "" : ", ") + toml_text(inner, whole);
    return '[' + out + ']';
  }
  if (const auto text = node.value_exact<std::string_view>()) return string_text(*text);
  if (const auto flag = node.value_exact<bool>()) return *flag ? "true" : "false";
  if (whole && node.is_integer()) return std::to_string(*node.value_exact<std::int64_t>());
  return number_text(number_in(&node).value_or(0.0));
}

/// Holds one table of TOML, and the tables in it, against keys.
class Check {
 public:
  Check(std::span<const Key> keys, const toml::table& root, std::string label, std::string name,
        std::vector<Problem>& problems)
      : keys_(keys),
        root_(root),
        label_(std::move(label)),
        name_(std::move(name)),
        problems_(problems) {}

  /// `others_are_parameters`: a key that the table does not know is a parameter of an effect.
  void run(bool others_are_parameters = false) {
    others_are_parameters_ = others_are_parameters;
    walk(root_, "");
    for (const Key& key : keys_) conditions(key);
  }

 private:
  void problem(const Place& place, const std::string& message) {
    problems_.push_back({name_, place.line, place.column, one_line(message)});
  }
  void problem(const toml::node& at, const std::string& message) {
    problem(place_of(at.source()), message);
  }
  std::string full(std::string_view path) const { return joined(label_, path); }

  void walk(const toml::table& table, std::string_view prefix) {
    for (const auto& [name, node] : table) {
      const std::string path = joined(prefix, name.str());
      // A name with a dot in it is one name, but would look like two.
      const bool plain = name.str().find('.') == std::string_view::npos;
      const Key* key = plain ? find_key(keys_, path) : nullptr;
      if (key != nullptr) {
        value(node, *key, path);
      } else if (plain && is_table_of(keys_, path)) {
        if (const toml::table* inner = node.as_table()) {
          walk(*inner, path);
        } else {
          wrong_.insert(path);
          problem(node, full(path) + ": expected a table, [" + full(path) + "], found " +
                            found_text(node));
        }
      } else if (others_are_parameters_) {
        static constexpr Key any{.path = "", .type = Type::parameter, .sentence = ""};
        value(node, any, path);
      } else {
        const toml::table* inner = node.as_table();
        unknown(name, path, prefix, inner != nullptr && !inner->is_inline());
      }
    }
  }

  void unknown(const toml::key& name, const std::string& path, std::string_view prefix,
               bool table) {
    const auto names = names_within(keys_, prefix);
    std::string message = (table ? "unknown table " : "unknown key ") + full(path);
    const std::string meant = nearest(name.str(), names);
    if (!meant.empty()) {
      meant_.insert(joined(prefix, meant));
      message += ": did you mean " + meant + "?";
    } else if (const std::string elsewhere = home_of(name.str()); !elsewhere.empty()) {
      meant_.insert(elsewhere);
      message += ": " + std::string(name.str()) + " belongs to [" +
                 std::string(parent_of(elsewhere)) + "]";
    } else {
      message += prefix.empty() && label_.empty() ? "; there are " : "; here may stand ";
      message += listed(names);
    }
    problem(place_of(name.source()), message);
  }

  /// The path of the one key, in another table, that has that name.
  std::string home_of(std::string_view name) const {
    std::string home;
    for (const Key& key : keys_) {
      if (name_in(key.path) != name || parent_of(key.path).empty()) continue;
      if (!home.empty() || key.path.find('*') != std::string_view::npos) return {};
      home = key.path;
    }
    return home;
  }

  void expected(const toml::node& node, const Key& key, const std::string& path) {
    wrong_.insert(path);
    problem(node, full(path) + ": expected " + expectation(key) + ", found " + found_text(node));
  }

  void value(const toml::node& node, const Key& key, const std::string& path) {
    switch (key.type) {
      case Type::number:
        if (!in_range(node, key)) expected(node, key, path);
        break;
      case Type::integer:
        if (!node.is_integer() || !in_range(node, key)) expected(node, key, path);
        break;
      case Type::boolean:
        if (!node.is_boolean()) expected(node, key, path);
        break;
      case Type::text:
      case Type::file:
        if (!node.is_string() || node.value<std::string_view>()->empty()) expected(node, key, path);
        break;
      case Type::choice:
        choice(node, key, path);
        break;
      case Type::parameter:
        parameter(node, key, path);
        break;
      case Type::filters:
        filters(node, key, path);
        break;
      case Type::envelope:
        envelope(node, key, path);
        break;
      case Type::lines:
        lines(node, key, path);
        break;
      case Type::terms:
        terms(node, key, path);
        break;
      case Type::span:
        span(node, key, path);
        break;
      case Type::faults:
        faults(node, key, path);
        break;
      case Type::date: {
        const auto text = node.value_exact<std::string_view>();
        if (!text || !utc_seconds(*text)) expected(node, key, path);
        break;
      }
      case Type::texts:
        texts(node, key, path);
        break;
      case Type::range: {
        const auto pair = pair_in(&node);
        if (!pair || (*pair)[0] >= (*pair)[1]) expected(node, key, path);
        break;
      }
      case Type::covariance:
        covariance(node, key, path);
        break;
      case Type::leaks:
        leaks(node, key, path);
        break;
      case Type::points:
        tables(node, key, path, point_keys());
        break;
      case Type::calibration:
        if (const toml::table* table = node.as_table()) {
          Check(calibration_keys(), *table, full(path), name_, problems_).run();
        } else {
          expected(node, key, path);
        }
        break;
      case Type::history:
        tables(node, key, path, history_keys());
        break;
      case Type::modbus_units:
        tables(node, key, path, modbus_unit_keys(), most_units);
        break;
      case Type::gauges:
        tables(node, key, path, gauge_keys(), most_units);
        break;
      case Type::registers:
        tables(node, key, path, register_keys(), most_registers);
        break;
      case Type::integers:
        integers(node, key, path);
        break;
    }
  }

  static bool in_range(const toml::node& node, const Key& key) {
    const auto number = number_in(&node);
    return number && std::isfinite(*number) &&
           (key.above_low ? *number > key.low : *number >= key.low) && *number <= key.high;
  }

  void choice(const toml::node& node, const Key& key, const std::string& path) {
    if (choice_in(&node, key)) return;
    wrong_.insert(path);
    std::string message =
        full(path) + ": expected " + expectation(key) + ", found " + found_text(node);
    if (const auto text = node.value_exact<std::string_view>()) {
      const auto choices = choices_of(key.choices);
      const std::string meant = nearest(*text, {choices.begin(), choices.end()});
      if (!meant.empty()) message += ": did you mean \"" + meant + "\"?";
    }
    problem(node, message);
  }

  void parameter(const toml::node& node, const Key& key, const std::string& path) {
    const toml::table* table = node.as_table();
    if (table == nullptr) {
      if (!in_range(node, key)) expected(node, key, path);
      return;
    }
    for (const auto& [name, inner] : *table) {
      if (name.str() != "value" && name.str() != "sigma") {
        wrong_.insert(path);
        problem(place_of(name.source()), "unknown key " + std::string(name.str()) + " in " +
                                             full(path) + ": expected " + expectation(key));
      }
    }
    if (const toml::node* value = table->get("value")) {
      if (!in_range(*value, key)) expected(*value, key, path);
    } else {
      wrong_.insert(path);
      problem(node, full(path) + ": lacks its value: expected " + expectation(key));
    }
    if (const toml::node* sigma = table->get("sigma")) {
      const auto number = number_in(sigma);
      if (!number || !std::isfinite(*number) || *number < 0.0) {
        wrong_.insert(path);
        problem(*sigma, full(path) +
                            ": sigma is a standard deviation, a number of 0 or more, found " +
                            found_text(*sigma));
      }
    } else {
      wrong_.insert(path);
      problem(node, full(path) +
                        ": lacks its sigma; a value that is known exactly is written as a "
                        "plain number");
    }
  }

  void filters(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    std::int64_t sections = 0;
    for (const toml::node& each : *list) {
      if (const toml::table* filter = each.as_table()) {
        Check(filter_keys(), *filter, full(path), name_, problems_).run();
        const auto order =
            std::clamp<std::int64_t>((*filter)["order"].value_or<std::int64_t>(1), 1, 8);
        sections += (order + 1) / 2;
      } else {
        expected(each, key, path);
      }
    }
    constexpr auto most = static_cast<std::int64_t>(physics::max_filter_sections);
    if (sections > most) {
      problem(node,
              full(path) + ": together more than " + std::to_string(2 * most) +
                  " poles (odd orders count as the next even one), which is no sensor's chain");
    }
  }

  void envelope(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    if (list->size() < 2) {
      problem(node,
              full(path) + ": needs two points or more, found " + std::to_string(list->size()));
    }
    double before = 0.0;
    bool first = true;
    for (const toml::node& each : *list) {
      const toml::array* point = each.as_array();
      const auto time =
          point != nullptr && point->size() == 2 ? number_in(point->get(0)) : std::nullopt;
      const auto amplitude = time ? number_in(point->get(1)) : std::nullopt;
      if (!amplitude || !std::isfinite(*time) || !std::isfinite(*amplitude)) {
        problem(each,
                full(path) + ": expected a point, [time_s, amplitude], found " + found_text(each));
        continue;
      }
      if (*amplitude < 0.0) {
        problem(*point->get(1),
                full(path) + ": an amplitude is 0 or more, found " + found_text(*point->get(1)));
      }
      if (first ? *time != 0.0 : *time <= before) {
        problem(*point->get(0), full(path) +
                                    (first ? ": the first time has to be 0, found "
                                           : ": times have to increase, found ") +
                                    found_text(*point->get(0)));
      }
      before = *time;
      first = false;
    }
  }

  void lines(const toml::node& node, const Key& key, const std::string& path) {
    constexpr std::size_t most_lines = 200;
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    if (list->empty() || list->size() > most_lines) {
      problem(node, full(path) + ": expected 1 to " + std::to_string(most_lines) +
                        " lines, found " + std::to_string(list->size()));
    }
    for (const toml::node& each : *list) {
      const toml::array* line = each.as_array();
      bool sound = line != nullptr && line->size() == 3;
      for (std::size_t i = 0; sound && i < 3; ++i) {
        const auto number = number_in(line->get(i));
        sound = number && std::isfinite(*number);
      }
      if (!sound) {
        problem(each, full(path) + ": expected a line, [frequency_hz, amplitude, phase_deg], " +
                          "found " + found_text(each));
        continue;
      }
      if (*number_in(line->get(0)) <= 0.0) {
        problem(*line->get(0),
                full(path) + ": a frequency is above 0 [Hz], found " + found_text(*line->get(0)));
      }
      if (*number_in(line->get(1)) < 0.0) {
        problem(*line->get(1),
                full(path) + ": an amplitude is 0 or more, found " + found_text(*line->get(1)));
      }
    }
  }

  void terms(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    for (const toml::node& each : *list) {
      if (const toml::table* term = each.as_table()) {
        const auto id = (*term)["id"].value<std::string_view>();
        Check(term_keys(), *term, id ? joined(path, *id) : path, name_, problems_).run(true);
      } else {
        expected(each, key, path);
      }
    }
  }

  void span(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr || list->size() != 2) return expected(node, key, path);
    const toml::node& from = *list->get(0);
    const toml::node& to = *list->get(1);
    if (in_range(from, key) && in_range(to, key) && *number_in(&from) < *number_in(&to)) return;
    wrong_.insert(path);
    problem(node, full(path) + ": expected " + expectation(key) + ", found [" + found_text(from) +
                      ", " + found_text(to) + "]");
  }

  void faults(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    if (list->size() > most_faults) {
      problem(*list->get(most_faults), full(path) + ": more than " + std::to_string(most_faults) +
                                           " in one script, found " + std::to_string(list->size()) +
                                           ": one fault can be repeated with every_s");
    }
    for (const toml::node& each : *list) {
      if (const toml::table* fault = each.as_table()) {
        const auto kind = (*fault)["kind"].value<std::string_view>().value_or("");
        const auto keys = fault_keys_of(kind);
        Check(keys, *fault, fault_label(*fault), name_, problems_).run();
      } else {
        expected(each, key, path);
      }
    }
  }

  void tables(const toml::node& node, const Key& key, const std::string& path,
              std::span<const Key> keys,
              std::size_t most = std::numeric_limits<std::size_t>::max()) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    if (list->size() > most) {
      problem(*list->get(most), full(path) + ": more than " + std::to_string(most) +
                                    " tables, found " + std::to_string(list->size()));
    }
    for (const toml::node& each : *list) {
      if (const toml::table* table = each.as_table()) {
        Check(keys, *table, full(path), name_, problems_).run();
      } else {
        expected(each, key, path);
      }
    }
  }

  void texts(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return expected(node, key, path);
    for (const toml::node& each : *list) {
      if (!each.is_string() || each.value<std::string_view>()->empty()) expected(each, key, path);
    }
  }

  void integers(const toml::node& node, const Key& key, const std::string& path) {
    const toml::array* list = node.as_array();
    if (list == nullptr || list->empty()) return expected(node, key, path);
    for (const toml::node& each : *list) {
      if (!each.is_integer()) expected(each, key, path);
    }
  }

  void covariance(const toml::node& node, const Key& key, const std::string& path) {
    const auto found = covariance_in(&node);
    if (!found) return expected(node, key, path);
    // Roots, since the product of two tiny variances may be no number any more.
    constexpr double rounding = 1.0 + 1.0e-9;
    const bool possible = found->offset >= 0.0 && found->gain >= 0.0 &&
                          std::abs(found->offset_gain) <=
                              std::sqrt(found->offset) * std::sqrt(found->gain) * rounding;
    if (!possible) {
      wrong_.insert(path);
      problem(node, full(path) +
                        ": is no covariance: variances are 0 or more, and the one in the middle is "
                        "at most the root of their product");
    }
  }

  void leaks(const toml::node& node, const Key& key, const std::string& path) {
    const toml::table* table = node.as_table();
    if (table == nullptr) return expected(node, key, path);
    std::vector<std::string> stems;
    for (const ChannelInfo& channel : channel_table) stems.emplace_back(channel.stem);
    for (const auto& [name, value] : *table) {
      const auto number = number_in(&value);
      if (std::find(stems.begin(), stems.end(), name.str()) == stems.end()) {
        const std::string meant = nearest(name.str(), stems);
        problem(
            place_of(name.source()),
            "unknown channel " + std::string(name.str()) + " in " + full(path) +
                (meant.empty() ? "; there are " + listed(stems) : ": did you mean " + meant + "?"));
      } else if (!number || !std::isfinite(*number)) {
        problem(value, full(path) + "." + std::string(name.str()) +
                           ": expected a number [SI/SI], found " + found_text(value));
      }
    }
  }

  /// What the condition of a key depends on, and whether it holds; nothing where that is not known.
  std::optional<bool> holds(std::string_view condition) const {
    if (condition.empty()) return true;
    const auto equals = condition.find('=');
    const std::string_view path = condition.substr(0, equals);
    if (wrong_.contains(std::string(path)) || is_meant(path)) return std::nullopt;
    const std::string value = value_of(path);
    if (value.empty()) return std::nullopt;
    const auto wanted = choices_of(condition.substr(equals + 1));
    return std::find(wanted.begin(), wanted.end(), value) != wanted.end();
  }

  /// The choice, or true or false, at a path, or what holds without the key; empty: unknown.
  std::string value_of(std::string_view path) const {
    const toml::node* node = node_at(root_, path);
    if (node == nullptr) return std::string(find_key(keys_, path)->fallback);
    if (const auto flag = node->value_exact<bool>()) return *flag ? "true" : "false";
    return node->value_exact<std::string>().value_or("");
  }

  /// Whether a misspelt key or table was taken for this one: then it is not said to be missing.
  bool is_meant(std::string_view path) const {
    for (; !path.empty(); path = parent_of(path)) {
      if (meant_.contains(std::string(path))) return true;
    }
    return false;
  }

  void conditions(const Key& key) {
    if (key.path.find('*') != std::string_view::npos) return;
    const toml::node* node = node_at(root_, key.path);
    const auto relevant = holds(key.when);
    if (!relevant) return;
    if (node != nullptr) {
      if (!*relevant && key.only_then) refuse(key, *node);
      return;
    }
    if (key.need == Need::optional || !*relevant || is_meant(key.path)) return;
    const std::string_view parent = parent_of(key.path);
    const toml::node* table = parent.empty() ? &root_ : node_at(root_, parent);
    if (table == nullptr && key.need == Need::in_table) return;
    if (table != nullptr && !table->is_table()) return;
    std::string message = full(key.path) + " is missing";
    if (!key.when.empty()) message += " with " + condition_text(key);
    message += ": expected " + expectation(key) + ". ";
    problem(nearest_place(parent), message + std::string(key.sentence));
  }

  void refuse(const Key& key, const toml::node& node) {
    problem(key_place(key.path, node), full(key.path) + " has no meaning with " +
                                           condition_text(key) + ": remove one of the two");
  }

  /// The key on which a condition depends, as the file has it: `law = "coulomb"`.
  std::string condition_text(const Key& key) const {
    const std::string_view path = key.when.substr(0, key.when.find('='));
    const std::string value = value_of(path);
    const std::string quote = find_key(keys_, path)->type == Type::choice ? "\"" : "";
    const std::string_view name = parent_of(path) == parent_of(key.path) ? name_in(path) : path;
    return std::string(name) + " = " + quote + value + quote;
  }

  Place key_place(std::string_view path, const toml::node& node) const {
    const std::string_view parent = parent_of(path);
    const toml::node* around = parent.empty() ? &root_ : node_at(root_, parent);
    if (around != nullptr && around->is_table()) {
      const auto at = around->as_table()->find(name_in(path));
      if (at != around->as_table()->end()) return place_of(at->first.source());
    }
    return place_of(node.source());
  }

  Place nearest_place(std::string_view path) const {
    for (; !path.empty(); path = parent_of(path)) {
      const toml::node* node = node_at(root_, path);
      if (node != nullptr && node->source().begin.line > 0) return place_of(node->source());
    }
    // A table within a file (a filter) stands somewhere; the file itself begins at its first line.
    const Place root = place_of(root_.source());
    return root.line > 0 ? root : Place{1, 1};
  }

  std::span<const Key> keys_;
  const toml::table& root_;
  std::string label_;  // path of root_ in the file
  std::string name_;
  std::vector<Problem>& problems_;
  bool others_are_parameters_ = false;
  std::set<std::string> wrong_;  // paths whose value is not to be relied on
  std::set<std::string> meant_;  // paths that misspelt keys were taken for
};

}  // namespace

std::string read_text(const std::filesystem::path& file) {
  const auto refuse = [&file](const std::string& why) -> InputError {
    return InputError(Problem{file.string(), 0, 0, why});
  };
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status)) throw refuse("there is no such file");
  if (std::filesystem::is_directory(status)) throw refuse("is a folder, expected a TOML file");
  if (std::filesystem::is_regular_file(status) &&
      std::filesystem::file_size(file, error) > largest_file) {
    throw refuse("is larger than 1 MiB: expected a rig, a model or a fault script in TOML");
  }
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw refuse(std::string("cannot be read: ") + std::strerror(errno));
  std::string text;
  std::array<char, 1U << 14U> block{};
  while (stream.read(block.data(), block.size()) || stream.gcount() > 0) {
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > largest_file) {
      throw refuse("is larger than 1 MiB: expected a rig, a model or a fault script in TOML");
    }
  }
  if (stream.bad()) throw refuse(std::string("cannot be read: ") + std::strerror(errno));
  return text;
}

struct Document::Contents {
  toml::table root;
};

Document::Document(std::string_view text, std::string name, std::span<const Key> keys)
    : name_(std::move(name)), keys_(keys), contents_(std::make_unique<Contents>()) {
  try {
    contents_->root = toml::parse(text, name_);
  } catch (const toml::parse_error& error) {
    const Place place = place_of(error.source());
    problems_.push_back({name_, place.line, place.column,
                         one_line("is not valid TOML: " + std::string(error.description()))});
    return;
  }
  Check(keys_, contents_->root, "", name_, problems_).run();
}

Document::~Document() = default;
Document::Document(Document&&) noexcept = default;
Document& Document::operator=(Document&&) noexcept = default;

void Document::report(std::string_view path, const std::string& message) {
  const toml::node* found = nullptr;
  std::string_view rest = path;
  constexpr std::string_view terms = "physics.";
  if (path.starts_with(terms)) {
    const std::string_view id =
        path.substr(terms.size(), path.find('.', terms.size()) - terms.size());
    if (const toml::array* list = contents_->root["physics"].as_array()) {
      for (const toml::node& each : *list) {
        const toml::table& term = *each.as_table();
        if (term["id"].value<std::string_view>() != id) continue;
        // Effects on a channel stand once for each: the channel follows the id in the path.
        const auto channel = term["channel"].value<std::string_view>();
        const std::string_view behind = path.substr(terms.size() + id.size());
        if (found != nullptr && channel && !behind.starts_with("." + std::string(*channel))) {
          continue;
        }
        const toml::node* value = term.get(path.substr(path.rfind('.') + 1));
        found = value != nullptr ? value : &each;
      }
    }
  } else {
    for (; found == nullptr && !rest.empty(); rest = parent_of(rest)) {
      const toml::node* node = node_at(contents_->root, rest);
      if (node != nullptr && node->source().begin.line > 0) found = node;
    }
  }
  const Place place = found != nullptr ? place_of(found->source()) : Place{1, 1};
  problems_.push_back(
      {name_, place.line, place.column, one_line(std::string(path) + ": " + message)});
}

void Document::report_fault(std::size_t position, std::string_view key,
                            const std::string& message) {
  const toml::table& fault = *contents_->root["fault"].as_array()->get(position)->as_table();
  const toml::node* value = fault.get(key);
  const Place place = place_of(value != nullptr ? value->source() : fault.source());
  problems_.push_back({name_, place.line, place.column,
                       one_line(joined(fault_label(fault), key) + ": " + message)});
}

void Document::add(const std::vector<Problem>& problems) {
  problems_.insert(problems_.end(), problems.begin(), problems.end());
}

std::vector<Problem> Document::take_problems() {
  std::vector<Problem> out = std::exchange(problems_, {});
  // Those of this file first, in its order; other files' in theirs.
  std::stable_sort(out.begin(), out.end(), [this](const Problem& a, const Problem& b) {
    const bool foreign_a = a.file != name_;
    const bool foreign_b = b.file != name_;
    if (foreign_a || foreign_b) return foreign_a < foreign_b;
    return std::pair(a.line, a.column) < std::pair(b.line, b.column);
  });
  return out;
}

bool Document::has(std::string_view path) const {
  return node_at(contents_->root, path) != nullptr;
}

bool Document::fault_has(std::size_t position, std::string_view key) const {
  return contents_->root["fault"].as_array()->get(position)->as_table()->contains(key);
}

std::optional<Stated> Document::stated(std::string_view path) const {
  const toml::node* node = node_at(contents_->root, path);
  const Key* key = find_key(keys_, path);
  if (node == nullptr || key == nullptr) return std::nullopt;
  const Place place = place_of(node->source());
  return Stated{toml_text(*node, key->type == Type::integer), place.line, place.column};
}

std::optional<double> Document::number(std::string_view path) const {
  return number_in(node_at(contents_->root, path));
}

std::optional<std::int64_t> Document::integer(std::string_view path) const {
  const toml::node* node = node_at(contents_->root, path);
  return node != nullptr ? node->value_exact<std::int64_t>() : std::nullopt;
}

std::optional<bool> Document::boolean(std::string_view path) const {
  const toml::node* node = node_at(contents_->root, path);
  return node != nullptr ? node->value_exact<bool>() : std::nullopt;
}

std::optional<std::string> Document::text(std::string_view path) const {
  const toml::node* node = node_at(contents_->root, path);
  return node != nullptr ? node->value_exact<std::string>() : std::nullopt;
}

std::optional<physics::Parameter> Document::parameter(std::string_view path) const {
  const toml::node* node = node_at(contents_->root, path);
  if (node == nullptr) return std::nullopt;
  return parameter_in(*node);
}

std::optional<std::size_t> Document::choice(std::string_view path) const {
  return choice_in(node_at(contents_->root, path), *find_key(keys_, path));
}

std::vector<physics::Filter> Document::filters(std::string_view path) const {
  std::vector<physics::Filter> out;
  const toml::node* node = node_at(contents_->root, path);
  if (node == nullptr) return out;
  for (const toml::node& each : *node->as_array()) {
    const toml::table& table = *each.as_table();
    physics::Filter filter;
    filter.kind = static_cast<physics::FilterKind>(
        choice_in(table.get("kind"), *find_key(filter_keys(), "kind")).value_or(0));
    filter.order = static_cast<int>(table["order"].value_or(std::int64_t{1}));
    filter.cutoff_hz = number_in(table.get("cutoff_hz")).value_or(0.0);
    out.push_back(filter);
  }
  return out;
}

std::vector<EnvelopePoint> Document::envelope(std::string_view path) const {
  std::vector<EnvelopePoint> out;
  const toml::node* node = node_at(contents_->root, path);
  if (node == nullptr) return out;
  for (const toml::node& each : *node->as_array()) {
    const toml::array& point = *each.as_array();
    out.push_back({number_in(point.get(0)).value_or(0.0), number_in(point.get(1)).value_or(0.0)});
  }
  return out;
}

std::vector<Line> Document::lines(std::string_view path) const {
  std::vector<Line> out;
  const toml::node* node = node_at(contents_->root, path);
  if (node == nullptr) return out;
  for (const toml::node& each : *node->as_array()) {
    const toml::array& line = *each.as_array();
    out.push_back({number_in(line.get(0)).value_or(0.0), number_in(line.get(1)).value_or(0.0),
                   number_in(line.get(2)).value_or(0.0)});
  }
  return out;
}

std::vector<physics::Term> Document::terms() const {
  std::vector<physics::Term> out;
  const toml::array* list = contents_->root["physics"].as_array();
  if (list == nullptr) return out;
  for (const toml::node& each : *list) {
    physics::Term term;
    for (const auto& [name, node] : *each.as_table()) {
      if (name.str() == "id") {
        term.id = node.value_or(std::string());
      } else if (name.str() == "channel") {
        term.channel = channel_named(node.value_or(std::string_view()));
      } else if (name.str() == "from") {
        term.from = channel_named(node.value_or(std::string_view()));
      } else {
        term.parameters.emplace(name.str(), parameter_in(node));
      }
    }
    out.push_back(std::move(term));
  }
  return out;
}

std::vector<Fault> Document::faults() const {
  std::vector<Fault> out;
  const toml::array* list = contents_->root["fault"].as_array();
  if (list == nullptr) return out;
  const auto choice = [](const toml::table& table, std::string_view key) {
    return choice_in(table.get(key), *find_key(fault_keys(), key));
  };
  for (const toml::node& each : *list) {
    const toml::table& table = *each.as_table();
    Fault fault;
    fault.kind = static_cast<FaultKind>(choice(table, "kind").value_or(0));
    if (const auto channel = choice(table, "channel")) fault.channel = all_channels.at(*channel);
    fault.from_s = number_in(table.get("at_s")).value_or(0.0);
    fault.to_s = fault.from_s;
    if (const toml::array* between = table["between_s"].as_array()) {
      fault.from_s = number_in(between->get(0)).value_or(0.0);
      fault.to_s = number_in(between->get(1)).value_or(0.0);
    }
    fault.duration_s = number_in(table.get("duration_s"));
    fault.every_s = number_in(table.get("every_s"));
    fault.probability = number_in(table.get("probability")).value_or(fault.probability);
    fault.amount = number_in(table.get("amount")).value_or(fault.amount);
    fault.reported = table["reported"].value_or(fault.reported);
    fault.stall_blocking = table["stall_blocking"].value_or(fault.stall_blocking);
    // A stall's length is its amount; what lasts is alike for all from here on.
    if (fault.kind == FaultKind::stall) fault.duration_s = fault.amount;
    out.push_back(fault);
  }
  return out;
}

std::optional<ChannelCalibration> Document::calibration(std::string_view path) const {
  const toml::node* node = node_at(contents_->root, path);
  if (node == nullptr) return std::nullopt;
  return calibration_in(*node->as_table());
}

std::vector<FormerCalibration> Document::history(std::string_view path) const {
  std::vector<FormerCalibration> out;
  const toml::node* node = node_at(contents_->root, path);
  if (node == nullptr) return out;
  for (const toml::node& each : *node->as_array()) {
    const toml::table& table = *each.as_table();
    const auto channel = channel_named(text_in(table, "channel"));
    out.push_back({channel.value_or(Channel::displacement), calibration_in(table)});
  }
  return out;
}

std::vector<ModbusUnit> Document::modbus_units() const {
  std::vector<ModbusUnit> out;
  const toml::array* list = contents_->root["modbus"].as_array();
  if (list == nullptr) return out;
  for (const toml::node& each : *list) {
    const toml::table& table = *each.as_table();
    const auto choice = [&table](std::string_view key) {
      return choice_in(table.get(key), *find_key(modbus_unit_keys(), key));
    };
    ModbusUnit unit;
    const auto whole = [&table](std::string_view key, int& target) {
      target = static_cast<int>(table[key].value_or(std::int64_t{target}));
    };
    const auto number = [&table](std::string_view key, double& target) {
      target = number_in(table.get(key)).value_or(target);
    };
    unit.name = text_in(table, "name");
    unit.transport = static_cast<ModbusTransport>(choice("transport").value_or(0));
    unit.port = text_in(table, "port");
    whole("baud", unit.baud);
    unit.parity = "NEO"[choice("parity").value_or(1)];
    whole("stop_bits", unit.stop_bits);
    whole("unit", unit.unit);
    unit.map_file = text_in(table, "map");
    number("poll_period_s", unit.poll_period_s);
    number("timeout_s", unit.timeout_s);
    whole("retries", unit.retries);
    number("pause_between_requests_s", unit.pause_between_requests_s);
    number("pause_after_connect_s", unit.pause_after_connect_s);
    out.push_back(std::move(unit));
  }
  return out;
}

std::vector<GaugeAt> Document::gauges() const {
  std::vector<GaugeAt> out;
  const toml::array* list = contents_->root["gauge"].as_array();
  if (list == nullptr) return out;
  for (const toml::node& each : *list) {
    const toml::table& table = *each.as_table();
    GaugeAt gauge;
    gauge.name = text_in(table, "name");
    const auto kind = choice_in(table.get("kind"), *find_key(gauge_keys(), "kind"));
    gauge.kind = static_cast<GaugeKind>(kind.value_or(0));
    gauge.port = text_in(table, "port");
    gauge.baud = static_cast<int>(table["baud"].value_or(std::int64_t{gauge.baud}));
    out.push_back(std::move(gauge));
  }
  return out;
}

std::vector<ModbusRegister> Document::registers() const {
  std::vector<ModbusRegister> out;
  const toml::array* list = contents_->root["register"].as_array();
  if (list == nullptr) return out;
  for (const toml::node& each : *list) {
    const toml::table& table = *each.as_table();
    const auto choose = [&table]<class Choice>(std::string_view key, Choice& target) {
      const auto found = choice_in(table.get(key), *find_key(register_keys(), key));
      if (found) target = static_cast<Choice>(*found);
    };
    ModbusRegister entry;
    entry.name = text_in(table, "name");
    choose("role", entry.role);
    choose("table", entry.table);
    entry.address = static_cast<int>(table["address"].value_or(std::int64_t{0}));
    choose("type", entry.type);
    choose("order", entry.order);
    entry.scale = number_in(table.get("scale")).value_or(entry.scale);
    entry.offset = number_in(table.get("offset")).value_or(entry.offset);
    entry.unit = text_in(table, "unit");
    entry.group = text_in(table, "group");
    if (const toml::array* ok = table["ok"].as_array()) {
      for (const toml::node& value : *ok) entry.ok.push_back(value.value_or(std::int64_t{0}));
    }
    entry.set_to = number_in(table.get("set_to"));
    entry.write_single = table["write_single"].value_or(false);
    out.push_back(std::move(entry));
  }
  return out;
}

std::optional<FileKind> kind_of(std::string_view text) {
  // Line by line, so that a file with a syntax error is still known for what it is.
  std::size_t rig = 0;
  std::size_t model = 0;
  std::size_t faults = 0;
  bool seed = false;
  std::size_t calibration = 0;
  std::size_t registers = 0;
  const auto model_tables = names_within(model_keys(), "");
  const auto rig_tables = names_within(rig_keys(), "");
  const auto calibration_tables = names_within(calibration_file_keys(), "");
  const auto has = [](const std::vector<std::string>& names, std::string_view name) {
    return name != "schema" && std::find(names.begin(), names.end(), name) != names.end();
  };
  while (!text.empty()) {
    const auto end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
    bool header = false;
    while (!line.empty() && (line.front() == ' ' || line.front() == '\t' || line.front() == '[')) {
      header = header || line.front() == '[';
      line.remove_prefix(1);
    }
    const std::string_view name = line.substr(0, line.find_first_of(".]= \t"));
    if (has(rig_tables, name)) ++rig;
    if (has(model_tables, name)) ++model;
    if (name == "fault") ++faults;
    if (header && name == "register") ++registers;
    if (name == "seed") seed = true;  // of a script without any fault yet; rigs have a seed, too
    // A key of that name may stand in the tables of a rig or a model as well.
    if (header && has(calibration_tables, name)) ++calibration;
  }
  if (registers > std::max({rig, model, faults, calibration})) return FileKind::modbus_map;
  const std::size_t most = std::max({rig, model, faults, calibration});
  if (most == 0) return seed ? std::optional(FileKind::fault_script) : std::nullopt;
  if (faults > std::max({rig, model, calibration})) return FileKind::fault_script;
  if (calibration > rig && calibration > model) return FileKind::calibration;
  return rig > model ? FileKind::rig : FileKind::model;
}

}  // namespace stickslip::config
