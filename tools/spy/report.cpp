// SPDX-License-Identifier: Apache-2.0
#include "tools/spy/report.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "physics/number_text.h"
#include "protocol/json_text.h"
#include "tools/terminal/text.h"

namespace stickslip::spy {

namespace {

using physics::counted;
using terminal::cut_to;
using terminal::padded;
using terminal::padded_left;
using terminal::Paint;
using terminal::printable;
using terminal::Tone;

std::string number(const char* format, double value) {
  std::array<char, 48> out{};
  const int size = std::snprintf(out.data(), out.size(), format, value);
  return physics::with_unsigned_zero({out.data(), static_cast<std::size_t>(std::max(size, 0))});
}

std::string hex(std::uint64_t value) {
  std::array<char, 24> out{};
  std::snprintf(out.data(), out.size(), "0x%016llx", static_cast<unsigned long long>(value));
  return out.data();
}

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

bool matches(const std::string& name, const std::vector<std::string>& filters) {
  const std::string lowered = lower(name);
  return filters.empty() ||
         std::any_of(filters.begin(), filters.end(), [&](const std::string& each) {
           return lowered.find(lower(each)) != std::string::npos;
         });
}

double sort_key(const ChannelTraffic& seen, Order order, std::int64_t now_us) {
  switch (order) {
    case Order::name:
      break;
    case Order::rate:
      return seen.rate_per_s;
    case Order::size:
      return seen.last_bytes;
    case Order::age:
      return seen.age_s(now_us);
    case Order::lost:
      return static_cast<double>(seen.sequence.lost + seen.undecoded);
  }
  return 0.0;
}

std::string type_text(const ChannelTraffic& seen) {
  return seen.type.empty() ? "unknown type " + hex(seen.fingerprint) : std::string(seen.type);
}

std::string unit_suffix(const Quantity& quantity) {
  return quantity.unit == "1" ? "" : " " + quantity.unit;
}

/// Text of a cell and its severity.
struct Cell {
  std::string text;
  Tone tone = Tone::plain;
};

Cell error_count(std::uint64_t count) {
  return {std::to_string(count), count > 0 ? Tone::bad : Tone::plain};
}

enum Heading : std::size_t {
  channel,
  messages,
  rate,
  jitter,
  kilobytes,
  size,
  age,
  lost,
  bad,
  type
};
constexpr std::array headings = {"CHANNEL", "MESSAGES", "RATE/s", "JITTER ms", "kB/s",
                                 "SIZE B",  "AGE s",    "LOST",   "BAD",       "TYPE"};
// Columns that are dropped on a narrow terminal, in this order. Losses stay.
constexpr std::array dispensable = {kilobytes, jitter, type, size, age, messages};
using Row = std::array<Cell, headings.size()>;
constexpr std::string_view separator = "  ";

Row row_of(const ChannelTraffic& seen, std::int64_t now_us) {
  return {Cell{printable(seen.channel)},
          Cell{std::to_string(seen.messages)},
          Cell{number("%.1f", seen.rate_per_s)},
          Cell{seen.jitter_s ? number("%.1f", *seen.jitter_s * 1e3) : "-"},
          Cell{number("%.1f", seen.bytes_per_s * 1e-3)},
          Cell{std::to_string(seen.last_bytes)},
          Cell{number("%.1f", std::max(0.0, seen.age_s(now_us)))},
          seen.is_frames ? error_count(seen.sequence.lost) : Cell{"-"},
          seen.type.empty() ? Cell{"-"} : error_count(seen.undecoded),
          seen.type.empty() ? Cell{"unknown", Tone::warning} : Cell{std::string(seen.type)}};
}

/// Width of each column; 0: dropped.
using Widths = std::array<std::size_t, headings.size()>;

Widths widths_of(const std::vector<Row>& rows, std::size_t columns) {
  Widths width{};
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < width.size(); ++i) {
      width[i] = std::max(width[i], terminal::columns_in(row[i].text));
    }
  }
  const auto all = [&width] {
    std::size_t sum = 0;
    for (const std::size_t each : width) sum += each > 0 ? each + separator.size() : 0;
    return sum - separator.size();
  };
  for (const Heading each : dispensable) {
    if (columns > 0 && all() > columns) width[each] = 0;
  }
  return width;
}

/// One line of the table, with numbers aligned to the right. A line that does not fit is truncated
/// and not coloured, which keeps control sequences whole.
std::string table_line(const Row& row, const Widths& width, std::size_t columns,
                       const Paint& paint) {
  std::string plain;
  std::string painted;
  for (std::size_t i = 0; i < row.size(); ++i) {
    if (width[i] == 0) continue;
    const bool left = i == channel || i == type;
    const std::string cell = left ? padded(row[i].text, i == channel ? width[i] : 0)
                                  : padded_left(row[i].text, width[i]);
    plain += (plain.empty() ? "" : separator);
    painted += (painted.empty() ? "" : separator);
    plain += cell;
    painted += paint(row[i].tone, cell);
  }
  const bool fits = columns == 0 || terminal::columns_in(plain) <= columns;
  return (fits ? painted : cut_to(plain, columns)) + "\n";
}

std::string text_line(const std::string& text, Tone tone, std::size_t columns, const Paint& paint) {
  const std::string line = printable(text);
  return paint(tone, columns == 0 ? line : cut_to(line, columns)) + "\n";
}

/// Frames and losses by their sequence numbers.
std::string frames_text(const ChannelTraffic& seen) {
  std::string out = counted(seen.sequence.frames, "frame") + ", lost " +
                    std::to_string(seen.sequence.lost) + " in " +
                    counted(seen.sequence.gaps, "gap");
  if (seen.sequence.restarts > 0) {
    out += ", restarted " + counted(seen.sequence.restarts, "time");
  }
  if (seen.degraded_blocks > 0) {
    out += ", " + counted(seen.degraded_blocks, "block") + " of degraded timing";
  }
  return out;
}

std::string quantity_text(const Quantity& quantity) {
  return padded(quantity.name, 18) + padded_left(number("%.5g", quantity.last), 13) +
         padded(unit_suffix(quantity), 7) + " from " +
         padded_left(number("%.5g", quantity.least), 12) + " to " +
         padded_left(number("%.5g", quantity.greatest), 12);
}

}  // namespace

std::vector<const ChannelTraffic*> selected_channels(const View& view, const Traffic& traffic,
                                                     std::int64_t now_us) {
  std::vector<const ChannelTraffic*> out = traffic.channels();
  std::erase_if(
      out, [&](const ChannelTraffic* each) { return !matches(each->channel, view.name_filters); });
  std::stable_sort(out.begin(), out.end(), [&](const ChannelTraffic* a, const ChannelTraffic* b) {
    return sort_key(*a, view.order, now_us) > sort_key(*b, view.order, now_us);
  });
  return out;
}

std::string table(const View& view, const Traffic& traffic, std::int64_t now_us,
                  std::size_t columns, const Paint& paint) {
  std::vector<Row> rows(1);
  for (std::size_t i = 0; i < headings.size(); ++i) rows[0][i] = {headings[i], Tone::faint};
  const auto seen = selected_channels(view, traffic, now_us);
  for (const ChannelTraffic* each : seen) rows.push_back(row_of(*each, now_us));
  const Widths width = widths_of(rows, columns);
  std::string out = table_line(rows[0], width, columns, paint);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const ChannelTraffic& each = *seen[i];
    out += table_line(rows[i + 1], width, columns, paint);
    if (each.type.empty()) out += text_line("  " + type_text(each), Tone::warning, columns, paint);
    if (each.is_frames) {
      const bool lost = each.sequence.lost > 0;
      out += text_line("  " + frames_text(each), lost ? Tone::bad : Tone::plain, columns, paint);
    }
    if (!each.summary.empty()) out += text_line("  " + each.summary, each.tone, columns, paint);
    if (!view.values) continue;
    for (const Quantity& quantity : each.quantities) {
      out += text_line("    " + quantity_text(quantity), Tone::plain, columns, paint);
    }
  }
  return out;
}

std::string lines(const View& view, const Traffic& traffic, std::int64_t now_us) {
  std::string out;
  for (const ChannelTraffic* each : selected_channels(view, traffic, now_us)) {
    std::string line = padded(each->channel, 22) + " " + counted(each->messages, "message") + ", " +
                       number("%.1f", each->rate_per_s) + "/s, " +
                       std::to_string(each->last_bytes) + " B, " + type_text(*each) + ", " +
                       number("%.1f", std::max(0.0, each->age_s(now_us))) + " s ago";
    if (each->is_frames) line += ", " + frames_text(*each);
    if (each->undecoded > 0) line += ", " + std::to_string(each->undecoded) + " not decoded";
    if (!each->summary.empty()) line += " | " + each->summary;
    out += printable(line) + "\n";
    if (!view.values) continue;
    for (const Quantity& quantity : each->quantities) {
      out += printable(each->channel + " " + quantity.name + " " + number("%.9g", quantity.last) +
                       unit_suffix(quantity) + ", from " + number("%.9g", quantity.least) + " to " +
                       number("%.9g", quantity.greatest)) +
             "\n";
    }
  }
  return out;
}

std::string json(const View& view, const Traffic& traffic, std::int64_t now_us, double seconds) {
  using Json = nlohmann::ordered_json;
  Json channels = Json::array();
  for (const ChannelTraffic* each : selected_channels(view, traffic, now_us)) {
    Json one = {{"channel", each->channel},
                {"type", each->type.empty() ? Json() : Json(std::string(each->type))},
                {"fingerprint", hex(each->fingerprint)},
                {"messages", each->messages},
                {"bytes", each->bytes},
                {"last_bytes", each->last_bytes},
                {"rate_per_s", each->rate_per_s},
                {"bytes_per_s", each->bytes_per_s},
                {"jitter_s", each->jitter_s ? Json(*each->jitter_s) : Json()},
                {"age_s", std::max(0.0, each->age_s(now_us))},
                {"not_decoded", each->undecoded},
                {"says", each->summary}};
    if (each->is_frames) {
      one["frames"] = {{"count", each->sequence.frames},
                       {"lost", each->sequence.lost},
                       {"gaps", each->sequence.gaps},
                       {"begun_anew", each->sequence.restarts},
                       {"degraded_blocks", each->degraded_blocks}};
    }
    one["values"] = Json::object();
    for (const Quantity& quantity : each->quantities) {
      one["values"][quantity.name] = {{"unit", quantity.unit},
                                      {"last", quantity.last},
                                      {"least", quantity.least},
                                      {"greatest", quantity.greatest}};
    }
    channels.push_back(std::move(one));
  }
  const Json out = {{"schema", 1}, {"seconds", seconds}, {"channels", std::move(channels)}};
  return protocol::json_text(out, -1) + "\n";
}

}  // namespace stickslip::spy
