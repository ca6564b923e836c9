// SPDX-License-Identifier: Apache-2.0
#include "daemon/calibration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace stickslip::daemon {
namespace {

constexpr std::uint8_t bit_of(std::size_t i) { return static_cast<std::uint8_t>(1U << i); }

void mark(std::uint8_t& mask, std::size_t i) { mask = static_cast<std::uint8_t>(mask | bit_of(i)); }

}  // namespace

Calibration::Calibration(const config::ChannelCalibrations& channels) {
  constexpr auto size = static_cast<Eigen::Index>(channel_count);
  Eigen::Matrix<double, size, size> mixing = Eigen::Matrix<double, size, size>::Identity();
  for (std::size_t i = 0; i < channel_count; ++i) {
    const config::ChannelCalibration& channel = channels[i];
    lines_[i].offset = channel.offset;
    lines_[i].gain = channel.gain;
    covariance_[i] = channel.covariance;
    if (channel.valid) {
      lines_[i].low = channel.valid->low;
      lines_[i].high = channel.valid->high;
      mark(ranged_, i);
    }
    for (std::size_t j = 0; j < channel_count; ++j) {
      if (channel.crosstalk[j] == 0.0) continue;
      mixing(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) += channel.crosstalk[j];
      mark(sources_[i], j);
      mark(crosstalk_, i);
    }
  }
  // Transitive closure of the crosstalk: one step per channel suffices.
  for (std::size_t step = 0; step < channel_count; ++step) {
    for (std::uint8_t& sources : sources_) {
      for (std::size_t j = 0; j < channel_count; ++j) {
        if ((sources & bit_of(j)) != 0) sources = static_cast<std::uint8_t>(sources | sources_[j]);
      }
    }
  }
  const Eigen::Matrix<double, size, size> inverse = mixing.partialPivLu().inverse();
  for (std::size_t i = 0; i < channel_count; ++i) {
    for (std::size_t j = 0; j < channel_count; ++j) {
      const auto row = static_cast<Eigen::Index>(i);
      const auto column = static_cast<Eigen::Index>(j);
      const bool coupled = i == j || (sources_[i] & bit_of(j)) != 0;
      mixing_[i][j] = mixing(row, column);
      unmixing_[i][j] = coupled ? inverse(row, column) : 0.0;
    }
  }
}

Calibrated Calibration::operator()(const Frame& raw) const {
  Calibrated out;
  out.frame.time_ns = raw.time_ns;
  out.frame.sequence = raw.sequence;
  for (Channel channel : all_channels) {
    if (!raw.has(channel)) continue;
    const std::size_t i = index_of(channel);
    // The sum with 0 removes the sign of a zero, which a table or a CSV recording would not have.
    const double si = (raw.value[i] - lines_[i].offset) * lines_[i].gain + 0.0;
    if (std::isfinite(si)) {
      out.frame.set(channel, si);
      out.frame.age_us[i] = raw.age_us[i];
    } else {
      mark(out.not_finite, i);
    }
  }
  if (crosstalk_ != 0) correct_crosstalk(out);
  for (std::size_t i = 0; ranged_ != 0 && i < channel_count; ++i) {
    if ((ranged_ & out.frame.valid & bit_of(i)) == 0) continue;
    const double si = out.frame.value[i];
    if (si < lines_[i].low || si > lines_[i].high) mark(out.out_of_range, i);
  }
  return out;
}

void Calibration::correct_crosstalk(Calibrated& out) const {
  const Frame read = out.frame;
  for (Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    if (!read.has(channel) || (crosstalk_ & bit_of(i)) == 0) continue;
    if ((sources_[i] & ~read.valid) != 0) {
      // The correction is unknown.
      mark(out.uncorrected, i);
      out.frame.invalidate(channel);
      continue;
    }
    double si = 0.0;
    std::int32_t age_us = read.age_us[i];
    for (std::size_t j = 0; j < channel_count; ++j) {
      if (unmixing_[i][j] == 0.0) continue;
      si += unmixing_[i][j] * read.value[j];
      age_us = std::max(age_us, read.age_us[j]);
    }
    if (std::isfinite(si)) {
      out.frame.value[i] = si;
      out.frame.age_us[i] = age_us;
    } else {
      mark(out.not_finite, i);
      out.frame.invalidate(channel);
    }
  }
}

double Calibration::sigma(const Frame& si, Channel channel) const {
  double variance = 0.0;
  for (std::size_t j = 0; j < channel_count; ++j) {
    const bool own = j == index_of(channel);
    const double weight = crosstalk_ == 0 ? (own ? 1.0 : 0.0) : unmixing_[index_of(channel)][j];
    if (weight == 0.0) continue;
    double reading = si.value[j];
    if (crosstalk_ != 0) {
      reading = 0.0;
      for (std::size_t k = 0; k < channel_count; ++k) reading += mixing_[j][k] * si.value[k];
    }
    config::ChannelCalibration line;
    line.gain = lines_[j].gain;
    line.covariance = covariance_[j];
    const double each = weight * config::calibration_sigma(line, reading);
    variance += each * each;
  }
  return std::sqrt(variance);
}

std::vector<std::string> unit_disagreements(const config::ChannelCalibrations& channels,
                                            const drivers::Description& device) {
  std::vector<std::string> out;
  for (Channel channel : all_channels) {
    const std::string& calibrated_in = channels[index_of(channel)].raw_unit;
    const char* read_in = device.unit[index_of(channel)];
    if (calibrated_in.empty() || read_in == nullptr || *read_in == '\0') continue;
    if (calibrated_in == read_in) continue;
    out.push_back(std::string(info(channel).stem) + " was calibrated in " + calibrated_in +
                  ", but " + device.name + " reads in " + read_in +
                  ": recalibrate it, or set the calibration file of this device");
  }
  return out;
}

}  // namespace stickslip::daemon
