// SPDX-License-Identifier: Apache-2.0
#include "tools/rig_access/daemon_rig.h"

#include <chrono>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <stickslip/frame_block_t.hpp>
#include <thread>
#include <vector>

#include "diagnosis/shooting.h"
#include "physics/failure.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"
#include "tools/telemetry/lcm_client.h"

namespace stickslip::rig_access {

namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using std::chrono::steady_clock;

// Of the signs of life: well within any safety.dead_man_s.
constexpr auto alive_period = 100ms;
// Of the end of a run, which is at rest, and of all frames.
constexpr double longest_missing_s = 0.5;
constexpr double least_received = 0.9;

[[noreturn]] void refuse(const std::string& what, const std::string& why) {
  throw InputError(Problem{what, 0, 0, why});
}

investigation::RigFacts facts_of(const json& rig) {
  investigation::RigFacts out;
  out.name = rig.value("name", "");
  out.rate_hz = rig.value("rate_hz", 1000.0);
  out.force = rig.value("drive", "") == "force";
  const json& limits = rig.at("limits");
  out.limits = out.force
                   ? design::DriveLimits{limits.at("force_n"), limits.at("force_slew_n_s"),
                                         std::numeric_limits<double>::infinity()}
                   : design::DriveLimits{limits.at("displacement_m"), limits.at("velocity_m_s"),
                                         limits.at("acceleration_m_s2")};
  for (const auto& [stem, range] : rig.at("ranges").items()) {
    const auto channel = channel_named(stem);
    if (!channel) continue;
    const std::size_t c = index_of(*channel);
    out.ranges.low[c] = range.value("low", out.ranges.low[c]);
    out.ranges.high[c] = range.value("high", out.ranges.high[c]);
  }
  return investigation::with_displacement_range(out);
}

}  // namespace

// Frames from a moment on, in order; a block that cannot be read is left out.
class DaemonRig::Receiver {
 public:
  void take(const lcm::ReceiveBuffer* buffer) {
    const std::span<const std::uint8_t> bytes(static_cast<const std::uint8_t*>(buffer->data),
                                              buffer->data_size);
    frame_block_t block{};
    std::vector<Frame> frames;
    if (!protocol::decode(bytes, block) || !protocol::from_block(block, frames)) return;
    for (const Frame& frame : frames) {
      if (frame.time_ns <= from_ns) continue;
      if (!recording.frames.empty() && frame.time_ns <= recording.frames.back().time_ns) continue;
      recording.channels = static_cast<std::uint8_t>(recording.channels | frame.valid);
      recording.frames.push_back(frame);
    }
  }

  std::int64_t from_ns = 0;
  protocol::Recording recording;
};

DaemonRig::DaemonRig(const std::string& socket) : client_(socket) {
  const json rig = ask("describe", json::object()).at("rig");
  if (rig.value("drive", "") == "imposed") {
    refuse(socket, "the rig's motion is imposed: it has no drive");
  }
  facts_ = facts_of(rig);
  model_text_ = rig.value("model", "");
  url_ = rig.value("lcm_url", "");
  if (url_.empty()) {
    refuse(socket, "the daemon publishes no frames that could be recorded: set lcm.enabled = true");
  }
  lcm_ = telemetry::join_lcm(url_);
}

DaemonRig::~DaemonRig() { restore_drive(); }

json DaemonRig::ask(const std::string& command, const json& arguments) {
  json answer = client_.ask(command, arguments);
  if (answer.value("ok", false)) return answer;
  refuse("the daemon", "refuses \"" + command + "\": " + answer.value("error", "no reason given"));
}

void DaemonRig::take_drive(const design::Drive& drive) {
  ask("drive", {{"period_s", drive.period_s}, {"samples", drive.samples}});
  drive_changed_ = true;
}

// The person's arming counts for the study: later runs are armed by their confirmation.
void DaemonRig::wait_until_armed(std::stop_token stop,
                                 const std::function<void(const std::string&)>& waiting) {
  bool said = false;
  for (;;) {
    const json now = client_.ask("alive");
    const std::string state = now.value("state", "");
    if (state == "armed") break;
    if (state == "running" || state == "stopping") {
      refuse("the rig", "is " + state + "; stop it first: stickslip ctl stop --wait");
    }
    if (state == "faulted" && armed_by_person_) {
      refuse("the rig", "faulted (" + now.value("cause", "") +
                            "): inspect it, clear the fault, and give the same command again");
    }
    if (state == "idle" && armed_by_person_) {
      ask("arm", json::object());
      break;
    }
    if (!said) {
      waiting(state == "faulted" ? "stickslip ctl clear, then stickslip ctl arm"
                                 : "stickslip ctl arm");
    }
    said = true;
    if (stop.stop_requested()) throw diagnosis::Interrupted();
    std::this_thread::sleep_for(alive_period);
  }
  armed_by_person_ = true;
}

protocol::Recording DaemonRig::run(const design::Drive& drive, std::stop_token stop,
                                   const std::function<void(const std::string&)>& waiting) {
  // A faulted rig takes no drive: a person clears and arms it first.
  wait_until_armed(stop, waiting);
  take_drive(drive);
  Receiver receiver;
  receiver.recording.source = url_;
  receiver.from_ns = client_.ask("alive").value("time_ns", std::int64_t{0});
  telemetry::check_reception(*lcm_);
  const auto pass = [](const lcm::ReceiveBuffer* buffer, const std::string&, Receiver* to) {
    to->take(buffer);
  };
  lcm::Subscription* const subscription =
      lcm_->subscribeFunction<Receiver*>(protocol::frames_channel, pass, &receiver);
  if (subscription == nullptr || subscription->setQueueCapacity(0) != 0) {
    telemetry::throw_lcm_error(std::string("does not subscribe to ") + protocol::frames_channel);
  }
  const auto ended = [&] { lcm_->unsubscribe(subscription); };
  try {
    ask("start", {{"dead_man", true}});
    follow(drive.duration_s() + 10.0, stop);
  } catch (...) {
    ended();
    throw;
  }
  ended();
  check_complete(receiver.recording, drive.duration_s());
  return std::move(receiver.recording);
}

void DaemonRig::check_complete(const protocol::Recording& recording, double duration_s) const {
  const std::vector<Frame>& frames = recording.frames;
  const double length_s =
      frames.empty() ? 0.0
                     : 1.0e-9 * static_cast<double>(frames.back().time_ns - frames.front().time_ns);
  if (length_s < duration_s - longest_missing_s) {
    refuse("the rig", "came to rest after " + physics::number_text(length_s, 3) + " of " +
                          physics::number_text(duration_s, 3) +
                          " s: another client has stopped it, or no frames arrive; give the same "
                          "command again to repeat the run");
  }
  const auto expected = static_cast<std::size_t>(length_s * facts_.rate_hz);
  if (static_cast<double>(frames.size()) < least_received * static_cast<double>(expected)) {
    refuse(url_, physics::counted(frames.size(), "frame") + " of " + std::to_string(expected) +
                     " arrived: LCM loses them; stickslip doctor names the cause");
  }
}

// Until the drive has come to rest by itself.
void DaemonRig::follow(double longest_s, std::stop_token stop) {
  const auto until = telemetry::after(steady_clock::now(), longest_s);
  auto next = steady_clock::now();
  for (;;) {
    while (lcm_->handleTimeout(20) > 0) {
      if (steady_clock::now() >= next) break;
    }
    if (steady_clock::now() < next) continue;
    next = steady_clock::now() + alive_period;
    if (stop.stop_requested()) {
      stop_rig();
      throw diagnosis::Interrupted();
    }
    const json now = client_.ask("alive");
    const std::string state = now.value("state", "");
    if (state == "faulted") {
      refuse("the rig", "faulted during the run (" + now.value("interlock", "") + ": " +
                            now.value("cause", "") +
                            "); the amplifier is off. Inspect it, clear the fault, arm the rig, "
                            "and give the same command again");
    }
    if (state == "idle" || state == "armed") break;
    if (steady_clock::now() > until) {
      stop_rig();
      refuse("the rig", "has not come to rest in time; it was stopped");
    }
  }
  // Frames that are still on their way.
  const auto late = steady_clock::now() + 200ms;
  while (steady_clock::now() < late) lcm_->handleTimeout(20);
}

void DaemonRig::stop_rig() {
  client_.ask("stop");
  for (int i = 0; i < 200; ++i) {
    const std::string state = client_.ask("alive").value("state", "");
    if (state != "running" && state != "stopping") return;
    std::this_thread::sleep_for(50ms);
  }
}

void DaemonRig::restore_drive() noexcept {
  if (!drive_changed_) return;
  try {
    client_.ask("drive");
  } catch (const std::exception&) {  // the daemon has gone
  }
}

}  // namespace stickslip::rig_access
