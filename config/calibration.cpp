#include "config/calibration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <initializer_list>
#include <utility>

#include "config/document.h"
#include "config/key.h"
#include "physics/problem.h"

namespace stickslip::config {

namespace {

constexpr double least_determinant = 0.1;

// Parts of a date: digits at fixed places.
std::optional<int> digits_at(std::string_view text, std::size_t at, std::size_t count) {
  if (at + count > text.size()) return std::nullopt;
  int value = 0;
  for (const char c : text.substr(at, count)) {
    if (c < '0' || c > '9') return std::nullopt;
    value = 10 * value + (c - '0');
  }
  return value;
}

std::optional<int> between(std::optional<int> value, int low, int high) {
  return value && *value >= low && *value <= high ? value : std::nullopt;
}

/// Seconds east of Greenwich of "Z" or "+hh:mm".
std::optional<int> zone_seconds(std::string_view zone) {
  if (zone == "Z") return 0;
  if (zone.size() != 6 || (zone[0] != '+' && zone[0] != '-') || zone[3] != ':') return std::nullopt;
  const auto hours = between(digits_at(zone, 1, 2), 0, 23);
  const auto minutes = between(digits_at(zone, 4, 2), 0, 59);
  if (!hours || !minutes) return std::nullopt;
  return (zone[0] == '-' ? -1 : 1) * (*hours * 3600 + *minutes * 60);
}

std::string toml_string(std::string_view text) {
  constexpr std::string_view hexadecimal = "0123456789abcdef";
  std::string out = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (byte < 0x20 || byte == 0x7f) {
      out += "\\u00";
      out += hexadecimal[byte >> 4U];
      out += hexadecimal[byte & 15U];
    } else {
      out += c;
    }
  }
  return out += '"';
}

class Writer {
 public:
  void line(std::string_view key, const std::string& value) {
    text_.append(key).append(" = ").append(value).append("\n");
  }
  void number(std::string_view key, double value) { line(key, number_text(value)); }
  void numbers(std::string_view key, std::initializer_list<double> values) {
    std::vector<std::string> texts;
    for (const double value : values) texts.push_back(number_text(value));
    list(key, "[", texts, "]");
  }
  void list(std::string_view key, std::string_view open, const std::vector<std::string>& texts,
            std::string_view close) {
    text_.append(key).append(" = ").append(open);
    for (std::size_t i = 0; i < texts.size(); ++i) text_.append(i > 0 ? ", " : "").append(texts[i]);
    text_.append(close).append("\n");
  }
  /// Leaves out what was not told.
  void text(std::string_view key, const std::string& value) {
    if (!value.empty()) line(key, toml_string(value));
  }
  void table(const std::string& name) { text_.append("\n[").append(name).append("]\n"); }
  void tables(const std::string& name) { text_.append("\n[[").append(name).append("]]\n"); }
  void comment(std::string_view words) { text_.append("# ").append(words).append("\n"); }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

/// The keys of a table that was begun; `path` is that of the table.
void write(Writer& out, const std::string& path, const ChannelCalibration& calibration) {
  out.number("offset", calibration.offset);
  out.number("gain", calibration.gain);
  if (calibration.covariance != LineCovariance{}) {
    out.numbers("covariance", {calibration.covariance.offset, calibration.covariance.offset_gain,
                               calibration.covariance.gain});
  }
  if (calibration.residual_std != 0.0) out.number("residual_std", calibration.residual_std);
  std::vector<std::string> leaks;
  for (Channel channel : all_channels) {
    const double leak = calibration.crosstalk[index_of(channel)];
    if (leak != 0.0) leaks.push_back(std::string(info(channel).stem) + " = " + number_text(leak));
  }
  if (!leaks.empty()) out.list("crosstalk", "{ ", leaks, " }");
  if (calibration.valid) {
    out.numbers("valid_range", {calibration.valid->low, calibration.valid->high});
  }
  out.text("raw_unit", calibration.raw_unit);
  out.text("date", calibration.date);
  out.text("reference", calibration.reference);
  out.text("by", calibration.by);
  if (!calibration.despite.empty()) {
    std::vector<std::string> texts;
    for (const std::string& each : calibration.despite) texts.push_back(toml_string(each));
    out.list("despite", "[", texts, "]");
  }
  for (const CalibrationPoint& point : calibration.points) {
    out.tables(path + ".point");
    out.number("raw", point.raw);
    if (point.raw_std != 0.0) out.number("raw_std", point.raw_std);
    out.number("reference_si", point.reference_si);
    if (point.reference_sigma != 0.0) out.number("reference_sigma", point.reference_sigma);
  }
}

/// What the table of keys cannot say about one channel's calibration.
void check(Document& document, const std::string& path, Channel channel,
           const ChannelCalibration& calibration) {
  if (calibration.gain == 0.0) {
    document.report(path + ".gain", "is 0, so that every reading would be 0");
  }
  if (calibration.crosstalk[index_of(channel)] != 0.0) {
    document.report(path + ".crosstalk", "names the channel itself: that is its gain");
  }
}

void check_order(Document& document, const CalibrationFile& file) {
  std::array<std::optional<std::int64_t>, channel_count> newer{};
  for (Channel channel : all_channels) {
    const auto& holds = file.channel[index_of(channel)];
    if (holds) newer[index_of(channel)] = utc_seconds(holds->date);
  }
  for (std::size_t i = 0; i < file.history.size(); ++i) {
    const FormerCalibration& each = file.history[i];
    std::optional<std::int64_t>& before = newer[index_of(each.channel)];
    const auto date = utc_seconds(each.calibration.date);
    if (before && date && *date > *before) {
      document.report("history." + std::to_string(i) + ".date",
                      "is newer than the calibration of " + std::string(info(each.channel).stem) +
                          " above it: the newest comes first");
    }
    before = date;
  }
}

}  // namespace

CalibrationFile load_calibration(const std::filesystem::path& file) {
  return parse_calibration(read_text(file), file.string());
}

CalibrationFile parse_calibration(std::string_view text, const std::string& name) {
  Document document(text, name, calibration_file_keys());
  CalibrationFile file;
  if (document.sound()) {
    ChannelCalibrations all{};
    for (Channel channel : all_channels) {
      const std::string path = "channel." + std::string(info(channel).stem);
      auto& calibration = file.channel[index_of(channel)];
      calibration = document.calibration(path);
      if (!calibration) continue;
      check(document, path, channel, *calibration);
      all[index_of(channel)] = *calibration;
    }
    file.history = document.history("history");
    for (std::size_t i = 0; i < file.history.size(); ++i) {
      check(document, "history." + std::to_string(i), file.history[i].channel,
            file.history[i].calibration);
    }
    check_order(document, file);
    // Also where it is no number at all.
    if (!(std::abs(crosstalk_determinant(all)) >= least_determinant)) {
      document.report("channel",
                      "channels leak into each other so much that they cannot be told apart: look "
                      "at their crosstalk");
    }
  }
  if (!document.sound()) throw InputError(document.take_problems());
  return file;
}

std::string calibration_text(const CalibrationFile& file) {
  Writer out;
  out.comment(
      "Written anew at each calibration: what was calibrated before is kept below, comments");
  out.comment("are not.");
  out.line("schema", "1");
  for (Channel channel : all_channels) {
    const auto& calibration = file.channel[index_of(channel)];
    if (!calibration) continue;
    const std::string path = "channel." + std::string(info(channel).stem);
    out.table(path);
    write(out, path, *calibration);
  }
  for (const FormerCalibration& each : file.history) {
    out.tables("history");
    out.text("channel", std::string(info(each.channel).stem));
    write(out, "history", each.calibration);
  }
  return out.take();
}

void renew(CalibrationFile& file, Channel channel, ChannelCalibration calibration,
           const std::string& name) {
  const std::string stem(info(channel).stem);
  const auto now = utc_seconds(calibration.date);
  if (!now) {
    throw InputError(Problem{name, 0, 0,
                             "the calibration of " + stem + " needs " +
                                 expectation(*find_key(calibration_keys(), "date")) + ", found \"" +
                                 calibration.date + "\""});
  }
  auto& holds = file.channel[index_of(channel)];
  if (holds) {
    if (utc_seconds(holds->date).value_or(*now) > *now) {
      throw InputError(Problem{name, 0, 0,
                               "the calibration of " + stem + " of " + holds->date +
                                   " is newer than the new one, " + calibration.date +
                                   ": is the clock right?"});
    }
    const std::array<double, channel_count> none{};
    if (calibration.crosstalk == none) calibration.crosstalk = holds->crosstalk;
    file.history.insert(file.history.begin(), {channel, *std::move(holds)});
  }
  holds = std::move(calibration);
}

double calibration_sigma(const ChannelCalibration& calibration, double si) {
  const LineCovariance& covariance = calibration.covariance;
  const double from_offset = si / calibration.gain;  // raw - offset
  const double variance = calibration.gain * calibration.gain * covariance.offset -
                          2.0 * si * covariance.offset_gain +
                          from_offset * from_offset * covariance.gain;
  return std::sqrt(std::max(0.0, variance));
}

double crosstalk_determinant(const ChannelCalibrations& calibrations) {
  constexpr auto size = static_cast<int>(channel_count);
  Eigen::Matrix<double, size, size> mixing = Eigen::Matrix<double, size, size>::Identity();
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      mixing(i, j) +=
          calibrations[static_cast<std::size_t>(i)].crosstalk[static_cast<std::size_t>(j)];
    }
  }
  return mixing.determinant();
}

std::optional<std::int64_t> utc_seconds(std::string_view iso_8601) {
  const auto year = digits_at(iso_8601, 0, 4);
  const auto month = digits_at(iso_8601, 5, 2);
  const auto day = digits_at(iso_8601, 8, 2);
  if (!year || !month || !day || iso_8601[4] != '-' || iso_8601[7] != '-') return std::nullopt;
  using namespace std::chrono;
  const year_month_day date{std::chrono::year(*year),
                            std::chrono::month(static_cast<unsigned>(*month)),
                            std::chrono::day(static_cast<unsigned>(*day))};
  if (!date.ok()) return std::nullopt;
  const std::int64_t midnight = sys_days(date).time_since_epoch().count() * std::int64_t{86400};
  if (iso_8601.size() == 10) return midnight;
  if (iso_8601.size() < 20 || iso_8601[10] != 'T' || iso_8601[13] != ':' || iso_8601[16] != ':') {
    return std::nullopt;
  }
  const auto hour = between(digits_at(iso_8601, 11, 2), 0, 23);
  const auto minute = between(digits_at(iso_8601, 14, 2), 0, 59);
  const auto second = between(digits_at(iso_8601, 17, 2), 0, 60);
  const auto zone = zone_seconds(iso_8601.substr(19));
  if (!hour || !minute || !second || !zone) return std::nullopt;
  return midnight + *hour * 3600 + *minute * 60 + *second - *zone;
}

}  // namespace stickslip::config
