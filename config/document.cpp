#include "config/document.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>

#include "physics/frame.h"

namespace stickslip::config {

namespace {

// Segments of a dotted path.
std::vector<std::string_view> segments_of(std::string_view path) {
  std::vector<std::string_view> segments;
  while (true) {
    const auto dot = path.find('.');
    segments.push_back(path.substr(0, dot));
    if (dot == std::string_view::npos) return segments;
    path.remove_prefix(dot + 1);
  }
}

bool is_channel(std::string_view stem) {
  return std::any_of(channel_table.begin(), channel_table.end(),
                     [stem](const ChannelInfo& each) { return each.stem == stem; });
}

// How many of a pattern's leading segments match; the whole pattern when that is its length.
bool matches(std::span<const std::string_view> pattern, std::span<const std::string_view> path) {
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (pattern[i] != path[i] && !(pattern[i] == "*" && is_channel(path[i]))) return false;
  }
  return true;
}

// Optimal string alignment distance: edits and swaps of neighbours.
std::size_t edits(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      d[i][j] = std::min(
          {d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
      }
    }
  }
  return d[a.size()][b.size()];
}

std::string list_of(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

std::string shown(const toml::node& value) {
  std::ostringstream text;
  value.visit([&text](const auto& each) {
    if constexpr (toml::is_value<decltype(each)>) {
      text << each;
    } else {
      text << (toml::is_table<decltype(each)> ? "a table" : "a list");
    }
  });
  return text.str();
}

std::string number_shown(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::vector<std::string> choices_of(const Key& key) {
  std::vector<std::string> list;
  std::string_view rest = key.choices;
  while (!rest.empty()) {
    const auto bar = rest.find('|');
    list.emplace_back(rest.substr(0, bar));
    rest.remove_prefix(bar == std::string_view::npos ? rest.size() : bar + 1);
  }
  return list;
}

}  // namespace

std::string file_text(const std::filesystem::path& file) {
  std::error_code failure;
  if (std::filesystem::is_directory(file, failure)) {
    throw InputError(Problem{file.string(), 0, 0, "is a folder; expected a TOML file"});
  }
  std::ifstream in(file, std::ios::binary);
  if (!in) {
    throw InputError(
        Problem{file.string(), 0, 0, std::string("cannot be read: ") + std::strerror(errno)});
  }
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

Document::Document(std::string_view text, std::string name, std::span<const Key> keys)
    : name_(std::move(name)), keys_(keys) {
  try {
    root_ = toml::parse(text, name_);
  } catch (const toml::parse_error& error) {
    add(error.source(), "no TOML: " + std::string(error.description()));
    return;
  }
  check(root_, "");
}

void Document::add(const toml::source_region& at, std::string message) {
  problems_.push_back({name_, static_cast<int>(at.begin.line), static_cast<int>(at.begin.column),
                       std::move(message)});
}

const toml::node* Document::node(std::string_view path) const {
  const toml::node* at = &root_;
  for (const std::string_view segment : segments_of(path)) {
    const toml::table* table = at->as_table();
    if (table == nullptr) return nullptr;
    at = table->get(segment);
    if (at == nullptr) return nullptr;
  }
  return at;
}

const Key* Document::key_for(std::string_view path) const {
  const auto segments = segments_of(path);
  for (const Key& key : keys_) {
    const auto pattern = segments_of(key.path);
    if (pattern.size() == segments.size() && matches(pattern, segments)) return &key;
  }
  return nullptr;
}

void Document::check(const toml::table& table, const std::string& prefix) {
  for (const auto& [key, value] : table) {
    const std::string path =
        prefix.empty() ? std::string(key.str()) : prefix + "." + std::string(key.str());
    if (const Key* known = key_for(path)) {
      check_value(value, *known, path);
      continue;
    }
    // Not a key itself: a table on the way to keys, or unknown.
    const auto segments = segments_of(path);
    bool on_the_way = false;
    std::vector<std::string> siblings;
    for (const Key& each : keys_) {
      const auto pattern = segments_of(each.path);
      if (pattern.size() < segments.size()) continue;
      const std::span<const std::string_view> all(pattern);
      if (!matches(all.first(segments.size() - 1), std::span(segments).first(segments.size() - 1)))
        continue;
      const std::string_view here = pattern[segments.size() - 1];
      if (pattern.size() > segments.size() && matches(all.first(segments.size()), segments))
        on_the_way = true;
      if (here == "*") {
        for (const ChannelInfo& channel : channel_table) siblings.emplace_back(channel.stem);
      } else {
        siblings.emplace_back(here);
      }
    }
    std::sort(siblings.begin(), siblings.end());
    siblings.erase(std::unique(siblings.begin(), siblings.end()), siblings.end());
    if (!on_the_way) {
      unknown(key, path, siblings);
    } else if (const toml::table* inner = value.as_table()) {
      check(*inner, path);
    } else {
      add(value.source(), path + " is " + shown(value) + "; expected a table [" + path + "]");
    }
  }
}

void Document::unknown(const toml::key& key, const std::string& path,
                       const std::vector<std::string>& siblings) {
  const std::string_view name = key.str();
  const auto nearest = std::min_element(siblings.begin(), siblings.end(),
                                        [name](const std::string& a, const std::string& b) {
                                          return edits(a, name) < edits(b, name);
                                        });
  std::string message = "unknown key " + path;
  if (nearest != siblings.end() &&
      edits(*nearest, name) <= std::max<std::size_t>(2, name.size() / 4)) {
    message += "; did you mean " + *nearest + "?";
  } else {
    message += "; expected one of " + list_of(siblings);
  }
  add(key.source(), message);
}

void Document::check_value(const toml::node& value, const Key& key, const std::string& path) {
  const auto wrong = [&](const std::string& expected) {
    add(value.source(), path + " is " + shown(value) + "; expected " + expected);
  };
  switch (key.type) {
    case Type::number:
      check_number(value, key, path);
      return;
    case Type::integer:
      if (!value.is_integer()) return wrong("a whole number");
      check_number(value, key, path);
      return;
    case Type::boolean:
      if (!value.is_boolean()) wrong("true or false");
      return;
    case Type::text:
    case Type::file: {
      const auto text = value.value<std::string>();
      if (!value.is_string() || text->empty()) wrong("a text in quotes");
      return;
    }
    case Type::choice: {
      const auto choices = choices_of(key);
      const auto text = value.value<std::string>();
      if (!value.is_string() || std::find(choices.begin(), choices.end(), *text) == choices.end()) {
        wrong("one of " + list_of(choices));
      }
      return;
    }
    case Type::parameter:
      check_parameter(value, key, path);
      return;
    case Type::filters:
      check_filters(value, path);
      return;
    case Type::envelope:
      check_envelope(value, path);
      return;
    case Type::terms:
      check_terms(value, path);
      return;
  }
}

void Document::check_number(const toml::node& value, const Key& key, const std::string& path) {
  const auto number = value.is_number() ? value.value<double>() : std::nullopt;
  const std::string unit =
      key.unit.empty() || key.unit == "1" ? "" : " [" + std::string(key.unit) + "]";
  if (!number) {
    add(value.source(), path + " is " + shown(value) + "; expected a number" + unit);
    return;
  }
  if (!std::isfinite(*number)) {
    add(value.source(),
        path + " is " + number_shown(*number) + "; expected a finite number" + unit);
    return;
  }
  if (*number < key.low || (key.above_low && *number == key.low)) {
    add(value.source(), path + " is " + number_shown(*number) + "; expected " +
                            (key.above_low ? "more than " : "at least ") + number_shown(key.low) +
                            unit);
  } else if (*number > key.high) {
    add(value.source(), path + " is " + number_shown(*number) + "; expected at most " +
                            number_shown(key.high) + unit);
  }
}

void Document::check_parameter(const toml::node& value, const Key& key, const std::string& path) {
  const toml::table* table = value.as_table();
  if (table == nullptr) {
    if (value.is_number()) return check_number(value, key, path);
    add(value.source(), path + " is " + shown(value) + "; expected a number [" +
                            std::string(key.unit) + "] or { value = ..., sigma = ... }");
    return;
  }
  for (const auto& [inner, node] : *table) {
    if (inner.str() == "value") {
      check_number(node, key, path + ".value");
    } else if (inner.str() == "sigma") {
      Key sigma = key;
      sigma.low = 0.0;
      sigma.above_low = false;
      sigma.high = std::numeric_limits<double>::infinity();
      check_number(node, sigma, path + ".sigma");
    } else {
      unknown(inner, path + "." + std::string(inner.str()), {"value", "sigma"});
    }
  }
  if (table->get("value") == nullptr) {
    add(value.source(), path + " has no value; expected { value = ..., sigma = ... }");
  }
}

void Document::check_filters(const toml::node& value, const std::string& path) {
  const toml::array* list = value.as_array();
  if (list == nullptr) {
    add(value.source(), path + " is " + shown(value) +
                            "; expected a list like [ { kind = \"butterworth_lowpass\", order = 4, "
                            "cutoff_hz = 25.0 } ]");
    return;
  }
  for (const toml::node& each : *list) {
    const toml::table* filter = each.as_table();
    if (filter == nullptr) {
      add(each.source(), path + " holds " + shown(each) + "; expected { kind, order, cutoff_hz }");
      continue;
    }
    const toml::node* kind = filter->get("kind");
    const auto name = kind != nullptr ? kind->value<std::string>() : std::nullopt;
    const bool butterworth = name == "butterworth_lowpass";
    if (!butterworth && name != "first_order_lowpass") {
      add(kind != nullptr ? kind->source() : each.source(),
          path + ".kind is " + (kind != nullptr ? shown(*kind) : "missing") +
              "; expected butterworth_lowpass or first_order_lowpass");
    }
    for (const auto& [inner, node] : *filter) {
      const std::string at = path + "." + std::string(inner.str());
      if (inner.str() == "cutoff_hz") {
        check_number(node, Key{"", Type::number, "Hz", "", "", 0.0, 1.0e9, true}, at);
      } else if (inner.str() == "order" && butterworth) {
        if (!node.is_integer()) {
          add(node.source(), at + " is " + shown(node) + "; expected a whole number, 1 to 8");
        } else {
          check_number(node, Key{"", Type::integer, "1", "", "", 1.0, 8.0}, at);
        }
      } else if (inner.str() == "order" && name == "first_order_lowpass") {
        add(inner.source(), at + " does not belong to a first_order_lowpass");
      } else if (inner.str() != "kind" && inner.str() != "order") {
        unknown(inner, at, {"kind", "order", "cutoff_hz"});
      }
    }
    if (filter->get("cutoff_hz") == nullptr)
      add(each.source(), path + ".cutoff_hz is missing [Hz]");
    if (butterworth && filter->get("order") == nullptr) {
      add(each.source(), path + ".order is missing; expected 1 to 8");
    }
  }
}

void Document::check_envelope(const toml::node& value, const std::string& path) {
  const toml::array* list = value.as_array();
  const auto expected =
      "; expected points like [ [0.0, 0.0], [10.0, 0.008] ], times increasing from 0";
  if (list == nullptr || list->empty()) {
    add(value.source(), path + " is " + (list == nullptr ? shown(value) : "empty") + expected);
    return;
  }
  double last = -1.0;
  for (const toml::node& each : *list) {
    const toml::array* point = each.as_array();
    const bool pair = point != nullptr && point->size() == 2 && point->get(0)->is_number() &&
                      point->get(1)->is_number();
    if (!pair) {
      add(each.source(), path + " holds " + shown(each) + expected);
      continue;
    }
    const double time = *point->get(0)->value<double>();
    const double amplitude = *point->get(1)->value<double>();
    if (!std::isfinite(time) || time < 0.0 || time <= last) {
      add(each.source(), path + ": time " + number_shown(time) + expected);
    }
    if (!std::isfinite(amplitude) || amplitude < 0.0) {
      add(each.source(), path + ": amplitude " + number_shown(amplitude) + "; expected 0 or more");
    }
    last = time;
  }
}

void Document::check_terms(const toml::node& value, const std::string& path) {
  const toml::array* list = value.as_array();
  if (list == nullptr) {
    add(value.source(), path + " is " + shown(value) + "; expected [[" + path + "]] tables");
    return;
  }
  for (const toml::node& each : *list) {
    const toml::table* term = each.as_table();
    if (term == nullptr) {
      add(each.source(), path + " holds " + shown(each) + "; expected [[" + path + "]] tables");
      continue;
    }
    const toml::node* id = term->get("id");
    if (id == nullptr || !id->is_string()) {
      add(id != nullptr ? id->source() : each.source(),
          path + ".id is " + (id != nullptr ? shown(*id) : "missing") +
              "; expected the name of an effect");
    }
    for (const auto& [inner, node] : *term) {
      const std::string at = path + "." + std::string(inner.str());
      if (inner.str() == "id") continue;
      if (inner.str() == "channel") {
        const auto channel = node.value<std::string>();
        if (!channel || !is_channel(*channel)) {
          add(node.source(), at + " is " + shown(node) + "; expected the name of a channel");
        }
        continue;
      }
      check_parameter(node, Key{"", Type::parameter, "its own", "", ""}, at);
    }
  }
}

std::optional<double> Document::number(std::string_view path) const {
  const toml::node* at = node(path);
  return at == nullptr ? std::nullopt : at->value<double>();
}

std::optional<std::int64_t> Document::integer(std::string_view path) const {
  const toml::node* at = node(path);
  return at == nullptr ? std::nullopt : at->value<std::int64_t>();
}

std::optional<bool> Document::boolean(std::string_view path) const {
  const toml::node* at = node(path);
  return at == nullptr ? std::nullopt : at->value<bool>();
}

std::optional<std::string> Document::text(std::string_view path) const {
  const toml::node* at = node(path);
  return at == nullptr ? std::nullopt : at->value<std::string>();
}

namespace {

physics::Parameter parameter_of(const toml::node& node) {
  if (const toml::table* table = node.as_table()) {
    return {(*table)["value"].value_or(0.0), (*table)["sigma"].value_or(0.0)};
  }
  return {node.value<double>().value_or(0.0), 0.0};
}

}  // namespace

std::optional<physics::Parameter> Document::parameter(std::string_view path) const {
  const toml::node* at = node(path);
  if (at == nullptr) return std::nullopt;
  return parameter_of(*at);
}

std::vector<physics::Filter> Document::filters(std::string_view path) const {
  std::vector<physics::Filter> out;
  const toml::node* at = node(path);
  const toml::array* list = at == nullptr ? nullptr : at->as_array();
  if (list == nullptr) return out;
  for (const toml::node& each : *list) {
    const toml::table* table = each.as_table();
    if (table == nullptr) continue;
    physics::Filter filter;
    const bool first_order = (*table)["kind"].value_or(std::string()) == "first_order_lowpass";
    filter.kind = first_order ? physics::FilterKind::first_order_lowpass
                              : physics::FilterKind::butterworth_lowpass;
    filter.order = first_order ? 1 : static_cast<int>((*table)["order"].value_or(4));
    filter.cutoff_hz = (*table)["cutoff_hz"].value_or(25.0);
    out.push_back(filter);
  }
  return out;
}

std::vector<std::pair<double, double>> Document::envelope(std::string_view path) const {
  std::vector<std::pair<double, double>> out;
  const toml::node* at = node(path);
  const toml::array* list = at == nullptr ? nullptr : at->as_array();
  if (list == nullptr) return out;
  for (const toml::node& each : *list) {
    const toml::array* point = each.as_array();
    if (point == nullptr || point->size() != 2) continue;
    out.emplace_back(point->get(0)->value<double>().value_or(0.0),
                     point->get(1)->value<double>().value_or(0.0));
  }
  return out;
}

std::vector<physics::Term> Document::terms(std::string_view path) const {
  std::vector<physics::Term> out;
  const toml::node* at = node(path);
  const toml::array* list = at == nullptr ? nullptr : at->as_array();
  if (list == nullptr) return out;
  for (const toml::node& each : *list) {
    const toml::table* table = each.as_table();
    if (table == nullptr) continue;
    physics::Term term;
    for (const auto& [key, value] : *table) {
      if (key.str() == "id") {
        term.id = value.value<std::string>().value_or("");
      } else if (key.str() == "channel") {
        term.channel = channel_named(value.value<std::string>().value_or(""));
      } else {
        term.parameters[std::string(key.str())] = parameter_of(value);
      }
    }
    out.push_back(std::move(term));
  }
  return out;
}

Document::Place Document::place_of(std::string_view path) const {
  // Terms are named by their id, "physics.cubic_stiffness.k3_n_m3", but stand in a list.
  const auto segments = segments_of(path);
  const toml::node* best = nullptr;
  const toml::node* at = &root_;
  for (std::size_t i = 0; i < segments.size() && at != nullptr; ++i) {
    if (const toml::array* list = at->as_array()) {
      const toml::node* found = nullptr;
      for (const toml::node& each : *list) {
        const toml::table* table = each.as_table();
        if (table != nullptr && (*table)["id"].value_or(std::string()) == segments[i])
          found = &each;
      }
      at = found;
    } else if (const toml::table* table = at->as_table()) {
      at = table->get(segments[i]);
    } else {
      at = nullptr;
    }
    if (at != nullptr) best = at;
  }
  if (best == nullptr) return {};
  // A list of tables has no place of its own in the file.
  if (const toml::array* list = best->as_array();
      list != nullptr && best->source().begin.line == 0) {
    if (!list->empty()) best = list->get(0);
  }
  return {static_cast<int>(best->source().begin.line),
          static_cast<int>(best->source().begin.column)};
}

void Document::blame(std::string_view path, const std::string& message) {
  const Place at = place_of(path);
  problems_.push_back({name_, at.line, at.column, std::string(path) + " " + message});
}

void Document::require(std::string_view path, std::string_view why) {
  if (has(path)) return;
  const Key* key = key_for(path);
  std::string message = "is missing";
  if (key != nullptr) {
    message += ": " + std::string(key->sentence);
    if (!key->unit.empty() && key->unit != "1") message += " [" + std::string(key->unit) + "]";
  }
  if (!why.empty()) message += "; " + std::string(why);
  blame(path, message);
}

}  // namespace stickslip::config
