// SPDX-License-Identifier: Apache-2.0
#include "tools/commissioning/bench_session.h"

#include <chrono>
#include <string_view>
#include <thread>
#include <utility>

#include "diagnosis/shooting.h"
#include "tools/commissioning/readings.h"

namespace stickslip::commissioning {

namespace {

using drivers::Outcome;
using std::chrono::steady_clock;

bool ends(Outcome outcome) {
  return outcome != Outcome::ok && outcome != Outcome::no_data && outcome != Outcome::temporary;
}

void leave_out_older(Frame& frame, std::int64_t begin_ns) {
  for (const Channel channel : all_channels) {
    if (frame.has(channel) && measured_ns(frame, channel) < begin_ns) frame.invalidate(channel);
  }
}

/// Stops the bench at the end of a run.
class Running {
 public:
  explicit Running(drivers::Driver& driver) : driver_(driver) {}
  ~Running() {
    driver_.write({0.0, false});
    driver_.stop();
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

 private:
  drivers::Driver& driver_;
};

}  // namespace

std::optional<drivers::Actuation> off(double) { return drivers::Actuation{}; }

BenchSession::BenchSession(std::unique_ptr<drivers::Driver> driver, const config::Rig& rig,
                           std::stop_token stop)
    : driver_(std::move(driver)), rig_(rig), stop_(std::move(stop)) {}

BenchSession::~BenchSession() { close(); }

std::string BenchSession::open() {
  if (open_) return {};
  driver_->close();  // of a bench that was lost
  const drivers::Result result = driver_->open();
  if (!result) return result.message;
  open_ = true;
  return {};
}

void BenchSession::close() {
  driver_->close();
  open_ = false;
}

RunEnd BenchSession::run(double longest_s, const std::function<bool(const Moment&)>& each,
                         const Command& command) {
  const drivers::Result started = driver_->start();
  const Running running(*driver_);
  RunEnd end{started.outcome, started.message};
  std::optional<std::int64_t> first_frame_ns;
  const auto begin = steady_clock::now();
  const auto now_s = [begin] {
    return std::chrono::duration<double>(steady_clock::now() - begin).count();
  };
  while (end.outcome == Outcome::ok && now_s() < longest_s) {
    if (stop_.stop_requested()) throw diagnosis::Interrupted();
    Moment moment;
    Frame frame;
    const drivers::Result read = driver_->read(frame);
    if (read) {
      if (!first_frame_ns) first_frame_ns = frame.time_ns;
      leave_out_older(frame, *first_frame_ns);
      moment.frame = frame;
    }
    if (ends(read.outcome)) end = {read.outcome, read.message};
    moment.time_s = now_s();
    moment.signals = driver_->signals();
    moment.outputs = driver_->output_readings();
    moment.age_sigma_us = driver_->age_sigma_us();
    if (ends(read.outcome) || !each(moment)) break;
    if (const auto actuation = command(moment.time_s)) {
      const drivers::Result written = driver_->write(*actuation);
      if (ends(written.outcome)) end = {written.outcome, written.message};
    }
  }
  if (end.outcome != Outcome::ok) open_ = false;
  return end;
}

void BenchSession::wait(double seconds) const {
  if (stop_.stop_requested()) throw diagnosis::Interrupted();
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

std::optional<bool> BenchSession::contact_on(const drivers::OutputReadings& outputs) const {
  const auto& contact = rig_.bench.readback.enable;
  if (!contact || !outputs.enable_v) return std::nullopt;
  return (*outputs.enable_v > contact->on_above_v) != contact->active_low;
}

double BenchSession::si(Channel channel, double raw) const {
  const config::ChannelCalibration& line = rig_.calibration[index_of(channel)];
  return (raw - line.offset) * line.gain;
}

std::uint64_t BenchSession::losses() const {
  std::uint64_t all = 0;
  for (const drivers::Count& count : driver_->counts().all()) {
    const std::string_view name = count.name;
    if (name == "packets_damaged" || name == "scans_lost" || name == "readings_missing" ||
        name == "readings_rejected" || name == "overruns") {
      all += count.value;
    }
  }
  return all;
}

std::string BenchSession::left_on() const {
  const char* const text = driver_->left_on();
  return text == nullptr ? std::string() : text;
}

}  // namespace stickslip::commissioning
