// SPDX-License-Identifier: Apache-2.0
#include "protocol/foreign_csv.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>

#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/recording_events.h"

namespace stickslip::protocol {

namespace {

// Contents of a column that are no channel: the time, or nothing of interest.
constexpr int time_column = -1;
constexpr int ignored = -2;

struct Unit {
  std::string_view name;
  std::string_view si;  // the unit of the channels that it fits
  double factor;
};

constexpr std::array units = {
    Unit{"s", "s", 1.0},          Unit{"ms", "s", 1.0e-3},      Unit{"us", "s", 1.0e-6},
    Unit{"\u00b5s", "s", 1.0e-6}, Unit{"\u03bcs", "s", 1.0e-6}, Unit{"ns", "s", 1.0e-9},
    Unit{"min", "s", 60.0},       Unit{"m", "m", 1.0},          Unit{"cm", "m", 1.0e-2},
    Unit{"mm", "m", 1.0e-3},      Unit{"um", "m", 1.0e-6},      Unit{"\u00b5m", "m", 1.0e-6},
    Unit{"\u03bcm", "m", 1.0e-6}, Unit{"nm", "m", 1.0e-9},      Unit{"km", "m", 1.0e3},
    Unit{"in", "m", 0.0254},      Unit{"m/s", "m/s", 1.0},      Unit{"cm/s", "m/s", 1.0e-2},
    Unit{"mm/s", "m/s", 1.0e-3},  Unit{"um/s", "m/s", 1.0e-6},  Unit{"km/s", "m/s", 1.0e3},
    Unit{"N", "N", 1.0},          Unit{"mN", "N", 1.0e-3},      Unit{"kN", "N", 1.0e3},
    Unit{"gf", "N", 9.80665e-3},  Unit{"kgf", "N", 9.80665},    Unit{"lbf", "N", 4.4482216152605},
};

// Names by which other programs call a quantity, in lower case, words parted by one space.
struct Alias {
  std::string_view name;
  int column;
};

constexpr int of(Channel channel) { return static_cast<int>(index_of(channel)); }

constexpr std::array aliases = {
    Alias{"time", time_column},
    Alias{"t", time_column},
    Alias{"zeit", time_column},
    Alias{"temps", time_column},
    Alias{"timestamp", time_column},
    Alias{"displacement", of(Channel::displacement)},
    Alias{"deflection", of(Channel::displacement)},
    Alias{"position", of(Channel::displacement)},
    Alias{"x", of(Channel::displacement)},
    Alias{"weg", of(Channel::displacement)},
    Alias{"velocity", of(Channel::velocity)},
    Alias{"speed", of(Channel::velocity)},
    Alias{"v", of(Channel::velocity)},
    Alias{"geschwindigkeit", of(Channel::velocity)},
    Alias{"friction force", of(Channel::friction_force)},
    Alias{"friction", of(Channel::friction_force)},
    Alias{"reibkraft", of(Channel::friction_force)},
    Alias{"normal load", of(Channel::normal_load)},
    Alias{"normal force", of(Channel::normal_load)},
    Alias{"normalkraft", of(Channel::normal_load)},
    Alias{"base displacement", of(Channel::base_displacement)},
    Alias{"base", of(Channel::base_displacement)},
    Alias{"b", of(Channel::base_displacement)},
    Alias{"drive force", of(Channel::drive_force)},
    Alias{"excitation force", of(Channel::drive_force)},
};

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t longest = 60;
  std::string out = "\"";
  for (const char c : text.substr(0, longest)) {
    out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  }
  return out + (text.size() > longest ? "...\"" : "\"");
}

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

std::string lower(std::string_view text) {
  std::string out;
  for (const char c : text) out += lower(c);
  return out;
}

// "friction force" of "Friction_Force"
std::string plain_name(std::string_view text) {
  std::string out = lower(trimmed(text));
  for (char& c : out) {
    if (c == '_' || c == '-' || c == '.') c = ' ';
  }
  return out;
}

const Unit* unit_named(std::string_view name) {
  for (const Unit& unit : units) {
    if (unit.name == name) return &unit;
  }
  if (name.find('M') != std::string_view::npos) return nullptr;  // MN is not mN
  for (const Unit& unit : units) {
    if (lower(unit.name) == lower(name)) return &unit;
  }
  return nullptr;
}

std::string_view si_unit(int column) {
  return column == time_column ? "s" : info(all_channels[static_cast<std::size_t>(column)]).unit;
}

std::string name_of(int column) {
  if (column == time_column) return "time_s";
  return std::string(info(all_channels[static_cast<std::size_t>(column)]).column);
}

std::string units_of(int column) {
  std::string list;
  for (const Unit& unit : units) {
    if (unit.si == si_unit(column) && static_cast<unsigned char>(unit.name.front()) < 0x80) {
      list += (list.empty() ? "" : ", ") + std::string(unit.name);
    }
  }
  return list;
}

// The quantity of a name without a unit.
std::optional<int> column_named(std::string_view name) {
  const std::string plain = plain_name(name);
  if (plain == "ignore") return ignored;
  if (plain == "time s") return time_column;
  if (const auto channel = channel_named(trimmed(name))) return of(*channel);
  for (const Alias& alias : aliases) {
    if (alias.name == plain) return alias.column;
  }
  return std::nullopt;
}

// A header cell: "x [mm]", "time (ms)", "Force/N", "displacement_mm".
struct Heading {
  std::string text;
  std::string name;  // without the unit
  std::string unit;  // empty: none
};

Heading heading_of(std::string_view cell) {
  Heading out{std::string(cell), std::string(cell), ""};
  for (const auto& [open, close] : {std::pair{'[', ']'}, std::pair{'(', ')'}}) {
    const auto at = cell.rfind(open);
    if (at == std::string_view::npos || !cell.ends_with(close)) continue;
    out.name = trimmed(cell.substr(0, at));
    out.unit = trimmed(cell.substr(at + 1, cell.size() - at - 2));
    return out;
  }
  // The first slash from the left behind which a unit stands: "v/m/s", "dx/dt / mm/s"
  for (std::size_t at = cell.find('/'); at != std::string_view::npos; at = cell.find('/', at + 1)) {
    if (unit_named(trimmed(cell.substr(at + 1))) == nullptr) continue;
    out.name = trimmed(cell.substr(0, at));
    out.unit = trimmed(cell.substr(at + 1));
    return out;
  }
  for (std::size_t at = cell.find('_'); at != std::string_view::npos; at = cell.find('_', at + 1)) {
    std::string unit(cell.substr(at + 1));
    std::replace(unit.begin(), unit.end(), '_', '/');
    if (unit_named(unit) == nullptr || !column_named(cell.substr(0, at))) continue;
    out.name = cell.substr(0, at);
    out.unit = unit_named(unit)->name;
    return out;
  }
  return out;
}

struct Column {
  int holds = ignored;
  std::string heading;
  double factor = 1.0;
};

class Importer {
 public:
  Importer(std::string_view text, const std::string& name, std::span<const ColumnRule> rules,
           const ProgressCallback& done)
      : text_(text), bytes_(text.size()), name_(name), rules_(rules), done_(done) {
    out_.recording.source = name;
  }

  ImportedRecording import() {
    if (text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);  // byte-order mark
    std::string_view line;
    while (next_line(line)) {
      if (trimmed(line).empty() || trimmed(line).front() == '#') continue;
      if (columns_.empty()) {
        read_header(line);
      } else if (is_cut_off_) {
        out_.recording.cut_off_line = line_;
        out_.recording.cut_off_bytes = line.size();
      } else {
        read_row(line);
      }
    }
    if (columns_.empty()) refuse("is empty: expected a header row of column names");
    if (out_.recording.frames.empty()) refuse("has no samples after its header");
    return std::move(out_);
  }

 private:
  [[noreturn]] void refuse(const std::string& message) const {
    throw InputError(Problem{name_, line_, 0, message});
  }

  bool next_line(std::string_view& line) {
    if (text_.empty()) return false;
    const auto end = text_.find('\n');
    line = text_.substr(0, end);
    if (line.ends_with('\r')) line.remove_suffix(1);
    is_cut_off_ = end == std::string_view::npos;
    text_.remove_prefix(is_cut_off_ ? text_.size() : end + 1);
    ++line_;
    if (done_ && line_ % 1024 == 0) {
      done_(1.0 - static_cast<double>(text_.size()) / static_cast<double>(bytes_));
    }
    return true;
  }

  // Cells, without quotes; "" within quotes is one.
  std::vector<std::string> cells_of(std::string_view line) const {
    std::vector<std::string> cells(1);
    bool inside = false;
    for (std::size_t i = 0; i < line.size(); ++i) {
      if (line[i] == '"') {
        if (inside && line.substr(i + 1).starts_with('"')) {
          cells.back() += line[i++];
          continue;
        }
        inside = !inside;
      } else if (line[i] == delimiter_ && !inside) {
        cells.emplace_back();
      } else {
        cells.back() += line[i];
      }
    }
    if (inside) refuse("has a quotation mark that is not closed");
    for (std::string& cell : cells) cell = std::string(trimmed(cell));
    return cells;
  }

  static std::size_t count_outside_quotes(std::string_view line, char wanted) {
    bool inside = false;
    std::size_t count = 0;
    for (const char c : line) {
      if (c == '"') inside = !inside;
      if (c == wanted && !inside) ++count;
    }
    return count;
  }

  void choose_separators(std::string_view header) {
    for (const char candidate : {';', '\t', ','}) {
      delimiter_ = candidate;
      if (count_outside_quotes(header, candidate) > 0) break;
    }
    if (count_outside_quotes(header, delimiter_) == 0) {
      refuse("its header has one column, " + in_quotes(trimmed(header)) +
             "; expected columns that are separated by semicolons, tabs or commas");
    }
    choose_decimal_sign();
    const std::string cells = delimiter_ == '\t'  ? "tabs"
                              : delimiter_ == ';' ? "semicolons"
                                                  : "commas";
    out_.guesses.push_back("columns are separated by " + cells + ", the decimal sign is a " +
                           (decimal_ == ',' ? "comma" : "point"));
  }

  // From the first rows: a comma that does not separate cells is a decimal sign.
  void choose_decimal_sign() {
    constexpr int most_rows = 200;
    std::string_view rest = text_;
    int commas = 0;
    int points = 0;
    for (int row = 1; row <= most_rows && !rest.empty(); ++row) {
      const auto end = rest.find('\n');
      const std::string_view line = trimmed(rest.substr(0, end));
      rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
      if (line.starts_with('#')) continue;
      for (const std::string& cell : cells_of(line)) {
        const bool numeric = cell.find_first_not_of("0123456789.,+-eE") == std::string::npos;
        if (!numeric) continue;
        commas += cell.find(',') != std::string::npos ? 1 : 0;
        points += cell.find('.') != std::string::npos ? 1 : 0;
      }
    }
    if (commas > 0 && points > 0) {
      refuse(
          "has numbers with points and numbers with commas in its first rows; expected one "
          "decimal sign, and no sign between groups of digits");
    }
    decimal_ = commas > 0 ? ',' : '.';
  }

  const ColumnRule* rule_for(const Heading& heading, std::optional<int> holds) {
    for (std::size_t i = 0; i < rules_.size(); ++i) {
      const std::string& wanted = rules_[i].column;
      const bool by_channel =
          holds && *holds != ignored &&
          (wanted == name_of(*holds) || (*holds == time_column && wanted == "time") ||
           (*holds >= 0 && wanted == info(all_channels[static_cast<std::size_t>(*holds)]).stem));
      if (wanted != heading.text && wanted != heading.name && !by_channel) continue;
      used_[i] = true;
      return &rules_[i];
    }
    return nullptr;
  }

  void read_header(std::string_view line) {
    choose_separators(line);
    used_.assign(rules_.size(), false);
    std::string not_used;
    for (const std::string& cell : cells_of(line)) {
      columns_.push_back(column_for(heading_of(cell)));
      if (columns_.back().holds != ignored) continue;
      not_used += (not_used.empty() ? "" : ", ") + in_quotes(cell);
    }
    check_columns();
    for (const Column& column : columns_) {
      if (column.holds == ignored) continue;
      out_.guesses.push_back(
          name_of(column.holds) + " is column " + in_quotes(column.heading) +
          (column.factor == 1.0 ? "" : " times " + physics::number_text(column.factor, 6)));
    }
    if (!not_used.empty()) out_.guesses.push_back("ignored: " + not_used);
  }

  Column column_for(const Heading& heading) {
    std::optional<int> holds = column_named(heading.name);
    if (lower(heading.name) == "force" || heading.name == "F") ambiguous_ = heading.text;
    const ColumnRule* rule = rule_for(heading, holds);
    if (rule != nullptr && rule->channel) {
      holds = column_named(*rule->channel);
      if (ambiguous_ == heading.text) ambiguous_.clear();
      if (!holds) {
        refuse("column " + in_quotes(heading.text) + " is to be " + in_quotes(*rule->channel) +
               "; expected time, ignore, or a channel such as displacement or drive_force");
      }
    }
    if (!holds || *holds == ignored) {
      if (rule != nullptr && !rule->channel) {
        refuse("column " + in_quotes(heading.text) + " has a unit by option, but its name is no " +
               "channel's; expected a mapping file (--map) that says which it is");
      }
      return {ignored, heading.text, 1.0};
    }
    Column out{*holds, heading.text, rule != nullptr ? rule->factor : 1.0};
    out.factor *= unit_factor(heading, rule, *holds);
    return out;
  }

  double unit_factor(const Heading& heading, const ColumnRule* rule, int holds) const {
    std::string unit = heading.unit;
    if (rule != nullptr && rule->unit) unit = *rule->unit;
    if (unit.empty()) {
      if (heading.text == name_of(holds)) return 1.0;
      refuse("column " + in_quotes(heading.text) + " (" + name_of(holds) +
             ") has no unit; expected one in the header, as in " +
             in_quotes(heading.text + " [" + std::string(si_unit(holds)) + "]") +
             ", or by option: --unit " +
             in_quotes(heading.text + "=" + std::string(si_unit(holds))));
    }
    const Unit* found = unit_named(unit);
    if (found == nullptr || found->si != si_unit(holds)) {
      refuse("column " + in_quotes(heading.text) + " (" + name_of(holds) + ") has the unit " +
             in_quotes(unit) + "; expected one of " + units_of(holds));
    }
    return found->factor;
  }

  void check_columns() const {
    for (std::size_t i = 0; i < rules_.size(); ++i) {
      if (used_[i]) continue;
      refuse("has no column " + in_quotes(rules_[i].column) +
             ", which an option or the mapping file names; its columns are " + all_headings());
    }
    if (!ambiguous_.empty()) {
      refuse(
          "column " + in_quotes(ambiguous_) +
          " may be the friction force or the drive force; expected a mapping file (--map) with " +
          in_quotes(ambiguous_) + " = { channel = \"friction_force\" } or drive_force");
    }
    for (const Column& column : columns_) {
      const auto same = [&](const Column& other) { return other.holds == column.holds; };
      if (column.holds == ignored || std::count_if(columns_.begin(), columns_.end(), same) == 1) {
        continue;
      }
      refuse("two of the columns " + all_headings() + " are " + name_of(column.holds) +
             "; expected one: set the other to \"ignore\" in a mapping file (--map)");
    }
    const auto has_time = [](const Column& column) { return column.holds == time_column; };
    const auto is_channel = [](const Column& column) { return column.holds >= 0; };
    if (std::none_of(columns_.begin(), columns_.end(), has_time)) {
      refuse("has no column of time (time_s, \"time [ms]\", ...); its columns are " +
             all_headings());
    }
    if (std::none_of(columns_.begin(), columns_.end(), is_channel)) {
      refuse("has no column that is a channel; its columns are " + all_headings() +
             ": a mapping file (--map) says what they are");
    }
  }

  std::string all_headings() const {
    std::string list;
    for (const Column& column : columns_)
      list += (list.empty() ? "" : ", ") + in_quotes(column.heading);
    return list;
  }

  void read_row(std::string_view line) {
    const auto cells = cells_of(line);
    // Some programs end every row with a separator.
    const bool one_more = cells.size() == columns_.size() + 1 && cells.back().empty();
    if (cells.size() != columns_.size() && !one_more) {
      refuse("has " + physics::counted(cells.size(), "cell") + "; the header names " +
             physics::counted(columns_.size(), "column"));
    }
    auto& frames = out_.recording.frames;
    Frame frame;
    frame.sequence = frames.size();
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (columns_[i].holds != ignored) read_cell(cells[i], columns_[i], frame);
    }
    if (!frames.empty() && frame.time_ns <= frames.back().time_ns) {
      refuse("time does not increase: " + physics::number_text(frame.time_s(), 12) + " s after " +
             physics::number_text(frames.back().time_s(), 12) + " s");
    }
    out_.recording.channels |= frame.valid;
    frames.push_back(frame);
  }

  void read_cell(const std::string& cell, const Column& column, Frame& frame) const {
    const bool is_time = column.holds == time_column;
    if (!is_time && (cell.empty() || lower(cell) == "nan")) return;  // not measured
    std::string text = cell.starts_with('+') ? cell.substr(1) : cell;
    if (decimal_ == ',') std::replace(text.begin(), text.end(), ',', '.');
    long double value = 0.0L;
    const char* last = text.data() + text.size();
    const auto [end, error] = std::from_chars(text.data(), last, value);
    const long double si = value * static_cast<long double>(column.factor);
    const bool fits = std::isfinite(si) && (!is_time || std::abs(si) < 9.2e9L);
    if (error != std::errc() || end != last || !fits) {
      refuse("column " + in_quotes(column.heading) + " holds " + in_quotes(cell) +
             "; expected a number with a decimal " + (decimal_ == ',' ? "comma" : "point") +
             (is_time ? ", below 9.2e9 s" : ", or an empty cell for a sample not measured"));
    }
    if (is_time) {
      frame.time_ns = std::llround(si * 1.0e9L);
    } else {
      frame.set(all_channels[static_cast<std::size_t>(column.holds)], static_cast<double>(si));
    }
  }

  std::string_view text_;
  std::size_t bytes_;
  std::string name_;
  std::span<const ColumnRule> rules_;
  const ProgressCallback& done_;
  int line_ = 0;
  bool is_cut_off_ = false;
  char delimiter_ = ',';
  char decimal_ = '.';
  std::vector<Column> columns_;
  std::vector<bool> used_;  // by rule
  std::string ambiguous_;   // heading of a force of unknown kind; empty: none
  ImportedRecording out_;
};

// True if the header has the column time_s of a file that is to be read strictly.
bool has_time_s(std::string_view text) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  while (!text.empty()) {
    std::string_view line = trimmed(text.substr(0, text.find('\n')));
    if (!line.empty() && line.front() != '#') {
      for (;;) {
        const auto comma = line.find(',');
        if (trimmed(line.substr(0, comma)) == "time_s") return true;
        if (comma == std::string_view::npos) return false;
        line.remove_prefix(comma + 1);
      }
    }
    const auto end = text.find('\n');
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return true;  // empty: the strict reader says so
}

}  // namespace

ImportedRecording import_csv(std::string_view text, const std::string& name,
                             std::span<const ColumnRule> rules, const ProgressCallback& done) {
  return Importer(text, name, rules, done).import();
}

ImportedRecording read_or_import(const std::filesystem::path& file,
                                 std::span<const ColumnRule> rules, bool always,
                                 const ProgressCallback& done, std::size_t most_frames) {
  std::error_code failure;
  std::ifstream in;
  if (!std::filesystem::is_directory(file, failure)) in.open(file, std::ios::binary);
  std::string text(1U << 16U, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(in.gcount()));
  const bool log = is_log(std::string_view(text).substr(0, 4));
  const bool strict = rules.empty() && !always && has_time_s(text);
  if (text.empty() || log || strict) return {read_recording(file, done, most_frames), {}};
  if (in) text.append(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  return import_csv(text, file.string(), rules, done);
}

}  // namespace stickslip::protocol
