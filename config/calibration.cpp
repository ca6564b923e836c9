// SPDX-License-Identifier: Apache-2.0
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
#include "config/toml_text.h"
#include "physics/problem.h"

namespace stickslip::config {

namespace {

constexpr double min_determinant = 0.1;

/// Number in fixed digits of a date.
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

void write_numbers(TomlWriter& out, std::string_view key, std::initializer_list<double> values) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(toml_number(value));
  out.list(key, "[", texts, "]");
}

/// Omits an empty text, which means unknown.
void write_known(TomlWriter& out, std::string_view key, const std::string& value) {
  if (!value.empty()) out.text(key, value);
}

/// Keys of a table that has been opened at `path`.
void write(TomlWriter& out, const std::string& path, const ChannelCalibration& calibration) {
  out.number("offset", calibration.offset);
  out.number("gain", calibration.gain);
  if (calibration.covariance != LineCovariance{}) {
    write_numbers(out, "covariance",
                  {calibration.covariance.offset, calibration.covariance.offset_gain,
                   calibration.covariance.gain});
  }
  if (calibration.residual_std != 0.0) out.number("residual_std", calibration.residual_std);
  std::vector<std::string> crosstalk;
  for (Channel channel : all_channels) {
    const double share = calibration.crosstalk[index_of(channel)];
    if (share != 0.0) {
      crosstalk.push_back(std::string(info(channel).stem) + " = " + toml_number(share));
    }
  }
  if (!crosstalk.empty()) out.list("crosstalk", "{ ", crosstalk, " }");
  if (calibration.valid) {
    write_numbers(out, "valid_range", {calibration.valid->low, calibration.valid->high});
  }
  write_known(out, "raw_unit", calibration.raw_unit);
  write_known(out, "date", calibration.date);
  write_known(out, "reference", calibration.reference);
  write_known(out, "by", calibration.by);
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

/// Checks of one channel's calibration beyond those of single keys.
void check(Document& document, const std::string& path, Channel channel,
           const ChannelCalibration& calibration) {
  if (calibration.gain == 0.0) {
    document.report(path + ".gain", "is 0: every reading would be 0");
  }
  if (calibration.crosstalk[index_of(channel)] != 0.0) {
    document.report(path + ".crosstalk", "names the channel itself: use gain instead");
  }
}

void check_order(Document& document, const CalibrationFile& file) {
  std::array<std::optional<std::int64_t>, channel_count> newer{};
  for (Channel channel : all_channels) {
    const auto& current = file.channel[index_of(channel)];
    if (current) newer[index_of(channel)] = utc_seconds(current->date);
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
  Document document(text, name, keys_of<CalibrationFile>());
  CalibrationFile file;
  if (document.sound()) {
    document.read(file);
    ChannelCalibrations all{};
    for (Channel channel : all_channels) {
      const std::string path = "channel." + std::string(info(channel).stem);
      const auto& calibration = file.channel[index_of(channel)];
      if (!calibration) continue;
      check(document, path, channel, *calibration);
      all[index_of(channel)] = *calibration;
    }
    for (std::size_t i = 0; i < file.history.size(); ++i) {
      check(document, "history." + std::to_string(i), file.history[i].channel,
            file.history[i].calibration);
    }
    check_order(document, file);
    // Negated, so that NaN is refused as well.
    if (!(std::abs(crosstalk_determinant(all)) >= min_determinant)) {
      document.report("channel",
                      "the crosstalk is so large that the channels cannot be separated: check "
                      "crosstalk");
    }
  }
  if (!document.sound()) throw InputError(document.take_problems());
  return file;
}

std::string calibration_text(const CalibrationFile& file) {
  TomlWriter out;
  out.comment("Rewritten at each calibration: previous calibrations are kept below, comments are");
  out.comment("not.");
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
                                 expectation(*find_key(keys_of<ChannelCalibration>(), "date")) +
                                 ", found \"" + calibration.date + "\""});
  }
  auto& current = file.channel[index_of(channel)];
  if (current) {
    if (utc_seconds(current->date).value_or(*now) > *now) {
      throw InputError(Problem{name, 0, 0,
                               "the calibration of " + stem + " of " + current->date +
                                   " is newer than the new one, " + calibration.date +
                                   ": is the clock right?"});
    }
    const std::array<double, channel_count> none{};
    if (calibration.crosstalk == none) calibration.crosstalk = current->crosstalk;
    file.history.insert(file.history.begin(), {channel, *std::move(current)});
  }
  current = std::move(calibration);
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
