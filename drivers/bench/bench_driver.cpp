// SPDX-License-Identifier: Apache-2.0
#include "drivers/bench/bench_driver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace stickslip::drivers {

BenchDriver::BenchDriver(BenchParts parts, const config::BenchInputs& inputs,
                         const config::ShakerOutput& shaker, RetryDelay retry,
                         const OutputChecks& output_checks)
    : clock_(std::move(parts.clock)),
      board_(std::move(parts.board)),
      amplifier_(std::move(parts.amplifier)),
      shaker_(shaker),
      board_has_clock_(board_->description().own_clock),
      output_checks_(output_checks) {
  if (output_checks_.any()) held_outputs_.resize(StreamClock::most_held);
  for (auto& gauge : parts.gauges) {
    gauges_.push_back(std::make_unique<GaugeReader>(std::move(gauge), retry));
  }
  connect(inputs);
  describe();
}

void BenchDriver::connect(const config::BenchInputs& inputs) {
  for (const Channel channel : all_channels) {
    const auto& wanted = inputs[index_of(channel)];
    const bool on_board = (board_->description().channels >> index_of(channel) & 1U) != 0;
    if (!wanted || on_board || connect(channel, *wanted)) continue;
    unmatched_ += (unmatched_.empty() ? "" : ", ") + std::string(info(channel).stem) + " from " +
                  wanted->device + "/" + wanted->input;
  }
  if (!unmatched_.empty()) unmatched_ = "no device of this bench provides " + unmatched_;
}

/// True if a gauge has that input.
bool BenchDriver::connect(Channel channel, const config::BenchInput& wanted) {
  for (std::size_t g = 0; g < gauges_.size(); ++g) {
    const auto own = gauges_[g]->gauge().inputs();
    for (std::size_t i = 0; i < own.size(); ++i) {
      if (own[i].device != wanted.device || own[i].name != wanted.input) continue;
      wires_.push_back({channel, g, i});
      return true;
    }
  }
  return false;
}

BenchDriver::~BenchDriver() {
  stop();
  close();
}

void BenchDriver::describe() {
  description_ = board_->description();
  description_.own_clock = false;
  for (const auto& gauge : gauges_) {
    description_.name += ", " + gauge->gauge().name();
    if (!gauge->remark().empty()) description_.name += " (" + gauge->remark() + ")";
  }
  for (const Wire& wire : wires_) {
    const std::size_t i = index_of(wire.channel);
    description_.channels = static_cast<std::uint8_t>(description_.channels | (1U << i));
    description_.unit[i] = gauges_[wire.gauge]->gauge().inputs()[wire.input].unit.c_str();
  }
}

Result BenchDriver::open() {
  if (!unmatched_.empty()) return {Outcome::needs_attention, unmatched_.c_str()};
  // The contact first: a line left active by a crashed daemon must be off before an output changes,
  // also if there is no board.
  Result result = amplifier_ ? amplifier_->open() : Result{};
  if (result) result = board_->open();
  for (const auto& gauge : gauges_) {
    if (result) result = gauge->open(!opened_before_);
  }
  if (!result) {
    // The message belongs to the device that failed; closing does not change it.
    close();
    return result;
  }
  // Once: other threads read the description while a lost device is reopened.
  if (!opened_before_) describe();
  opened_before_ = true;
  left_on_.clear();
  return {};
}

Result BenchDriver::start() {
  stream_clock_.restart();
  output_checks_.restart();
  return board_->start();
}

Result BenchDriver::read_board(Frame& scan) {
  const Result result = board_->read(scan);
  if (result && !held_outputs_.empty()) {
    held_outputs_[scan.sequence % held_outputs_.size()] = {scan.sequence,
                                                           board_->output_readings()};
  }
  return result;
}

void BenchDriver::check_outputs(const Frame& scan) {
  if (held_outputs_.empty()) return;
  const SequencedOutputs& held = held_outputs_[scan.sequence % held_outputs_.size()];
  if (held.sequence != scan.sequence) return;
  outputs_ = held.outputs;
  output_checks_.read(outputs_, scan.time_ns);
}

/// The next scan of the board, in host time.
Result BenchDriver::next_scan(Frame& scan) {
  if (!board_has_clock_) return read_board(scan);
  if (stream_clock_.next(scan)) return {};
  Frame raw;
  const Result result = read_board(raw);
  if (result) {
    const std::uint64_t before = stream_clock_.restarts();
    stream_clock_.take(raw, clock_->now_ns());
    clock_restarts_.fetch_add(stream_clock_.restarts() - before, std::memory_order_relaxed);
  } else if (result.outcome == Outcome::no_data) {
    stream_clock_.found_nothing();
  }
  if (stream_clock_.next(scan)) return {};
  return result ? Result{Outcome::no_data} : result;
}

/// Of a reading with an uncertain time, against the board's scans.
std::int32_t BenchDriver::sigma_of_age_us(std::int64_t reading_sigma_ns) const {
  const std::int64_t board_ns = board_has_clock_ ? stream_clock_.sigma_ns() : 0;
  const double sigma_us =
      1e-3 * std::hypot(static_cast<double>(reading_sigma_ns), static_cast<double>(board_ns));
  return static_cast<std::int32_t>(std::min(sigma_us, 1e9));
}

Result BenchDriver::read(Frame& frame) {
  Frame reading;
  const Result result = next_scan(reading);
  if (!result) return result;
  const std::int64_t host_ns = reading.time_ns;
  for (const Wire& wire : wires_) {
    const Reading latest = gauges_[wire.gauge]->latest(wire.input, host_ns);
    if (!latest.valid || gauges_[wire.gauge]->lost() != nullptr) continue;
    reading.set(wire.channel, latest.value);
    constexpr std::int64_t oldest_us = std::numeric_limits<std::int32_t>::max();
    const std::int64_t age_us = std::min((host_ns - latest.time_ns) / 1000, oldest_us);
    reading.age_us[index_of(wire.channel)] = static_cast<std::int32_t>(age_us);
    age_sigma_us_[index_of(wire.channel)].store(sigma_of_age_us(latest.sigma_ns),
                                                std::memory_order_relaxed);
  }
  check_outputs(reading);
  frame = reading;
  return {};
}

double BenchDriver::volts_of(double drive) const {
  return std::clamp(shaker_.rest_v + shaker_.volts_per_unit * drive, shaker_.low_v, shaker_.high_v);
}

Result BenchDriver::write(const Actuation& actuation) {
  const bool finite = std::isfinite(actuation.drive);
  const bool on = actuation.amplifier_on && finite;
  const Actuation volts{on ? volts_of(actuation.drive) : shaker_.rest_v, on};
  // An "off" must reach both, whatever the first returns.
  Result contacts;
  if (amplifier_ && !on) contacts = amplifier_->write(false);
  const Result board = board_->write(volts);
  // A temporary failure may pass by the next cycle: a closed contact stays closed until an
  // interlock opens it, and an open one stays open.
  const bool tolerated = board.outcome == Outcome::temporary && contact_on_;
  if (amplifier_ && on) contacts = amplifier_->write(board || tolerated);
  contact_on_ = on && (board || tolerated);
  if (output_checks_.any()) output_checks_.command(volts.drive, on, clock_->now_ns());
  if (!finite) return {Outcome::fatal, "the commanded drive is not finite"};
  return board ? contacts : board;
}

void BenchDriver::stop() noexcept {
  contact_on_ = false;
  switch_contact_off();
  board_->stop();
}

void BenchDriver::switch_contact_off() noexcept {
  if (!amplifier_) return;
  const Result off = amplifier_->switch_off();
  if (off) return;
  try {
    left_on_ = std::string(
                   "the amplifier's enable contact may still be closed: press the "
                   "emergency stop, then check chip and cable. The last \"off\" failed: ") +
               off.message;
  } catch (...) {  // out of memory for the message
  }
}

const char* BenchDriver::left_on() const noexcept {
  return left_on_.empty() ? board_->left_on() : left_on_.c_str();
}

void BenchDriver::close() noexcept {
  if (amplifier_) amplifier_->close();
  board_->close();
  for (const auto& gauge : gauges_) gauge->close();
}

Counts BenchDriver::counts() const noexcept {
  Counts all = board_->counts();
  if (board_has_clock_) {
    all.add({"clock of the board", "restarts", clock_restarts_.load(std::memory_order_relaxed)});
  }
  for (std::size_t i = 0; i < gauges_.size(); ++i) {
    const char* name = gauges_[i]->gauge().name().c_str();
    const GaugeLosses losses = gauges_[i]->losses();
    all.add({name, "readings_missing", losses.missing});
    all.add({name, "readings_rejected", losses.rejected});
    const auto wire = std::find_if(wires_.begin(), wires_.end(),
                                   [i](const Wire& each) { return each.gauge == i; });
    if (wire == wires_.end()) continue;
    const auto& sigma_us = age_sigma_us_[index_of(wire->channel)];
    const auto shown = static_cast<std::uint64_t>(sigma_us.load(std::memory_order_relaxed));
    all.add({name, "age_sigma_us", shown, Count::Kind::level});
  }
  return all;
}

std::array<std::int32_t, channel_count> BenchDriver::age_sigma_us() const noexcept {
  std::array<std::int32_t, channel_count> out{};
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = age_sigma_us_[i].load(std::memory_order_relaxed);
  }
  return out;
}

Signals BenchDriver::signals() const noexcept {
  Signals all = board_->signals();
  const auto add = [&all](const Signals& more) {
    all.emergency_stop = all.emergency_stop || more.emergency_stop;
    all.amplifier_fault = all.amplifier_fault || more.amplifier_fault;
  };
  all.differing_output = output_checks_.differing();
  if (amplifier_) add(amplifier_->signals());
  for (const auto& gauge : gauges_) {
    add(gauge->signals());
    if (all.lost_device == nullptr) all.lost_device = gauge->lost();
  }
  return all;
}

}  // namespace stickslip::drivers
