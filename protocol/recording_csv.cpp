// SPDX-License-Identifier: Apache-2.0
// CSV recordings; selection of the format of a recording.
#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>
#include <optional>
#include <ostream>
#include <string_view>

#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/unsigned_zero.h"
#include "protocol/recording.h"
#include "protocol/recording_events.h"
#include "protocol/recording_log.h"
#include "protocol/spread_frames.h"

namespace stickslip::protocol {

namespace {

constexpr int time_column = -1;
constexpr int derived_column = -2;
/// Of columns that were computed from the others, such as those of the live view's export.
constexpr std::string_view derived_prefix = "derived_";

std::string columns_known() {
  std::string list = "time_s";
  for (const ChannelInfo& channel : channel_table) list += ", " + std::string(channel.column);
  return list;
}

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  const auto last = text.find_last_not_of(" \t\r");
  return text.substr(first, last - first + 1);
}

// Text of a file for a message: on one line and abbreviated.
std::string shown(std::string_view text) {
  constexpr std::size_t longest = 60;
  std::string out;
  for (const char c : text.substr(0, longest)) {
    out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  }
  return text.size() > longest ? out + "..." : out;
}

// A decimal number in its parts: [-]whole.fraction e exponent.
struct Decimal {
  bool negative = false;
  std::string_view whole;
  std::string_view fraction;
  int exponent = 0;
};

std::string_view take_digits(std::string_view& text) {
  const std::string_view digits = text.substr(0, text.find_first_not_of("0123456789"));
  text.remove_prefix(digits.size());
  return digits;
}

std::optional<Decimal> decimal(std::string_view text) {
  Decimal out;
  if (text.starts_with('-') || text.starts_with('+')) {
    out.negative = text.front() == '-';
    text.remove_prefix(1);
  }
  out.whole = take_digits(text);
  if (text.starts_with('.')) {
    text.remove_prefix(1);
    out.fraction = take_digits(text);
  }
  if (out.whole.empty() && out.fraction.empty()) return std::nullopt;
  if (text.starts_with('e') || text.starts_with('E')) {
    const bool plus = text.substr(1).starts_with('+') && !text.substr(2).starts_with('-');
    text.remove_prefix(plus ? 2 : 1);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out.exponent);
    if (error != std::errc() || std::abs(out.exponent) > 1000) return std::nullopt;
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  }
  if (!text.empty()) return std::nullopt;
  return out;
}

// Nanoseconds from decimal seconds, rounded to the nearest. Exact, unlike a double at large times.
std::optional<std::int64_t> nanoseconds(std::string_view text) {
  const auto number = decimal(text);
  if (!number) return std::nullopt;
  std::uint64_t magnitude = 0;
  const auto shift = [&magnitude](unsigned digit) {
    return !__builtin_mul_overflow(magnitude, 10U, &magnitude) &&
           !__builtin_add_overflow(magnitude, digit, &magnitude);
  };
  // Power of ten, in nanoseconds, of the next digit.
  int place = static_cast<int>(std::min<std::size_t>(number->whole.size(), 100000)) - 1 +
              number->exponent + 9;
  for (const std::string_view part : {number->whole, number->fraction}) {
    for (const char c : part) {
      const auto digit = static_cast<unsigned>(c - '0');
      if (place == -1 && digit >= 5 && __builtin_add_overflow(magnitude, 1U, &magnitude)) {
        return std::nullopt;
      }
      if (place >= 0 && !shift(digit)) return std::nullopt;
      --place;
    }
  }
  for (; place >= 0 && magnitude != 0; --place) {
    if (!shift(0)) return std::nullopt;
  }
  constexpr std::uint64_t limit = INT64_MAX;
  if (magnitude > limit + (number->negative ? 1U : 0U)) return std::nullopt;
  return static_cast<std::int64_t>(number->negative ? ~magnitude + 1U : magnitude);
}

class CsvParser {
 public:
  CsvParser(std::string_view text, const std::string& name, const ProgressCallback& done,
            std::size_t most_frames)
      : text_(text), bytes_(text.size()), name_(name), done_(done), frames_(most_frames) {
    recording_.source = name;
  }

  Recording parse() {
    if (text_.substr(0, 3) == "\xEF\xBB\xBF") text_.remove_prefix(3);  // byte-order mark
    std::string_view line;
    while (next_line(line)) {
      if (line.empty() || line.front() == '#') continue;
      if (columns_.empty()) {
        read_header(line);
      } else if (is_cut_off_) {
        recording_.cut_off_line = line_;
        recording_.cut_off_bytes = line.size();
      } else {
        read_row(line);
      }
    }
    if (columns_.empty()) {
      line_ = 0;
      refuse("is empty: expected a header row of column names (" + columns_known() + ")");
    }
    frames_.finish(recording_);
    if (recording_.frames.empty() && is_cut_off_ && recording_.cut_off_line > 0) {
      refuse("its only row has no newline and may be cut within a number");
    }
    if (recording_.frames.empty()) refuse("has no samples after its header");
    if (recording_.channels == 0) {
      line_ = 0;
      refuse("has no values: every cell but time_s is empty");
    }
    return std::move(recording_);
  }

 private:
  [[noreturn]] void refuse(const std::string& message) const {
    throw InputError(Problem{name_, line_, 0, message});
  }

  bool next_line(std::string_view& line) {
    if (text_.empty()) return false;
    const auto end = text_.find('\n');
    line = trimmed(text_.substr(0, end));
    is_cut_off_ = end == std::string_view::npos;
    text_.remove_prefix(is_cut_off_ ? text_.size() : end + 1);
    ++line_;
    if (done_ && line_ % 1024 == 0) {
      done_(1.0 - static_cast<double>(text_.size()) / static_cast<double>(bytes_));
    }
    return true;
  }

  void read_header(std::string_view line) {
    bool time = false;
    bool has_channel = false;
    for (const std::string_view cell : cells_of(line)) {
      int column = time_column;
      if (cell.starts_with(derived_prefix)) {
        columns_.push_back(derived_column);
        continue;
      }
      if (cell != "time_s") {
        const auto channel = channel_named(cell);
        if (!channel || info(*channel).column != cell) {
          refuse("unknown column \"" + shown(cell) + "\"; expected " + columns_known() +
                 "; `stickslip convert --import` reads other names and units");
        }
        column = static_cast<int>(index_of(*channel));
      }
      if (std::find(columns_.begin(), columns_.end(), column) != columns_.end()) {
        refuse("column \"" + std::string(cell) + "\" occurs twice");
      }
      time = time || column == time_column;
      has_channel = has_channel || column != time_column;
      columns_.push_back(column);
    }
    if (!time) refuse("has no column time_s; its header is \"" + shown(line) + "\"");
    if (!has_channel) refuse("has no channel besides time_s; expected one of " + columns_known());
  }

  std::vector<std::string_view> cells_of(std::string_view line) const {
    std::vector<std::string_view> cells;
    while (true) {
      const auto comma = line.find(',');
      cells.push_back(trimmed(line.substr(0, comma)));
      if (comma == std::string_view::npos) return cells;
      line.remove_prefix(comma + 1);
    }
  }

  void read_row(std::string_view line) {
    Frame frame;
    frame.sequence = frames_.count();
    std::size_t column = 0;
    std::string_view rest = line;
    while (true) {
      const auto comma = rest.find(',');
      const std::string_view cell = trimmed(rest.substr(0, comma));
      if (column == columns_.size()) {
        refuse("has more cells than the header's " + physics::counted(columns_.size(), "column"));
      }
      read_cell(cell, columns_[column], frame);
      ++column;
      if (comma == std::string_view::npos) break;
      rest.remove_prefix(comma + 1);
    }
    if (column < columns_.size()) {
      refuse("has " + physics::counted(column, "cell") + "; the header names " +
             physics::counted(columns_.size(), "column"));
    }
    if (frames_.count() > 0 && frame.time_ns <= last_ns_) {
      refuse("time does not increase: " + time_text(frame.time_ns) + " s after " +
             time_text(last_ns_) + " s");
    }
    last_ns_ = frame.time_ns;
    recording_.channels |= frame.valid;
    frames_.add(frame);
  }

  void read_cell(std::string_view cell, int column, Frame& frame) const {
    if (column == time_column) {
      const auto time = nanoseconds(cell);
      if (!time)
        refuse("time_s is \"" + shown(cell) +
               "\"; expected seconds as a decimal number, below 9.2e9");
      frame.time_ns = *time;
      return;
    }
    if (cell.empty() || column == derived_column) return;  // not measured
    const Channel channel = all_channels[static_cast<std::size_t>(column)];
    double value = 0.0;
    const bool plus = cell.front() == '+' && cell.substr(1, 1) != "-";
    const char* begin = cell.data() + (plus ? 1 : 0);
    const auto [end, error] = std::from_chars(begin, cell.data() + cell.size(), value);
    if (error != std::errc() || end != cell.data() + cell.size() || !std::isfinite(value)) {
      refuse(std::string(info(channel).column) + " is \"" + shown(cell) +
             "\"; expected a finite number in " + std::string(info(channel).unit) +
             ", or an empty cell for a sample that was not measured");
    }
    frame.set(channel, value);
  }

 public:
  static std::string time_text(std::int64_t time_ns) {
    const bool negative = time_ns < 0;
    const std::uint64_t magnitude =
        negative ? ~static_cast<std::uint64_t>(time_ns) + 1 : static_cast<std::uint64_t>(time_ns);
    std::string decimals = std::to_string(magnitude % 1'000'000'000U);
    decimals.insert(0, 9 - decimals.size(), '0');
    while (decimals.size() > 3 && decimals.back() == '0') decimals.pop_back();
    std::string text = negative ? "-" : "";
    text += std::to_string(magnitude / 1'000'000'000U);
    text += '.';
    return text += decimals;
  }

 private:
  std::string_view text_;
  std::size_t bytes_;
  std::string name_;
  const ProgressCallback& done_;
  int line_ = 0;
  bool is_cut_off_ = false;  ///< the current line has no newline
  std::vector<int> columns_;
  SpreadFrames frames_;
  std::int64_t last_ns_ = 0;
  Recording recording_;
};

}  // namespace

Recording parse_csv(std::string_view text, const std::string& name, const ProgressCallback& done,
                    std::size_t most_frames) {
  return CsvParser(text, name, done, most_frames).parse();
}

namespace {

// Without the copies that a text of unknown length takes while it grows.
std::string content_of(std::istream& in, const std::filesystem::path& file) {
  std::error_code unknown;
  const auto bytes = std::filesystem::file_size(file, unknown);
  if (unknown || bytes == 0) {
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }
  std::string text(bytes, '\0');
  in.read(text.data(), static_cast<std::streamsize>(bytes));
  text.resize(static_cast<std::size_t>(in.gcount()));
  return text;
}

}  // namespace

Recording read_recording(const std::filesystem::path& file, const ProgressCallback& done,
                         std::size_t most_frames) {
  std::error_code failure;
  if (std::filesystem::is_directory(file, failure)) {
    throw InputError(
        Problem{file.string(), 0, 0, "is a folder; expected a recording (CSV or LCM log)"});
  }
  std::ifstream in(file, std::ios::binary);
  if (!in) {
    throw InputError(
        Problem{file.string(), 0, 0, std::string("cannot be read: ") + std::strerror(errno)});
  }
  std::array<char, 4> head{};
  in.read(head.data(), head.size());
  const auto got = static_cast<std::size_t>(in.gcount());
  if (is_log({head.data(), got})) return read_log(file, done, most_frames);
  in.clear();
  in.seekg(0);
  return parse_csv(content_of(in, file), file.string(), done, most_frames);
}

void write_csv(const Recording& recording, std::ostream& out, const ProgressCallback& done) {
  std::uint8_t channels = recording.channels;
  for (const Frame& frame : recording.frames) channels |= frame.valid;
  std::string text = "time_s";
  for (const Channel channel : all_channels) {
    if (((channels >> index_of(channel)) & 1U) == 0) continue;
    text += ',';
    text += info(channel).column;
  }
  text += "\n";
  std::size_t written = 0;
  for (const Frame& frame : recording.frames) {
    if (done && ++written % 1024 == 0) {
      done(static_cast<double>(written) / static_cast<double>(recording.frames.size()));
    }
    text += CsvParser::time_text(frame.time_ns);
    for (const Channel channel : all_channels) {
      if (((channels >> index_of(channel)) & 1U) == 0) continue;
      text += ',';
      if (frame.has(channel)) physics::append_shortest(text, frame[channel]);
    }
    text += '\n';
    if (text.size() > 1U << 16U) {
      out << text;
      text.clear();
    }
  }
  out << text;
}

void write_recording(const Recording& recording, const std::filesystem::path& file,
                     const ProgressCallback& done) {
  if (file == "-") {
    write_csv(recording, std::cout, done);
    std::cout.flush();
    return;
  }
  const auto extension = file.extension();
  if (extension == ".lcm" || extension == ".log") {
    write_log(recording, file, 10, done);
    return;
  }
  if (extension != ".csv") {
    throw InputError(Problem{file.string(), 0, 0, "expected a name that ends with .csv or .log"});
  }
  std::ofstream out(file, std::ios::binary);
  if (out) write_csv(recording, out, done);
  out.close();
  if (!out) {
    throw InputError(
        Problem{file.string(), 0, 0, std::string("cannot be written: ") + std::strerror(errno)});
  }
}

}  // namespace stickslip::protocol
