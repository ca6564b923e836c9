// SPDX-License-Identifier: Apache-2.0
// An acceptance of a bench of emulated devices by a person that does what each question asks for,
// unless a test replaces an action.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <functional>
#include <mutex>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "config/rig.h"
#include "drivers/factory/make_bench.h"
#include "tests/emulated/wires.h"
#include "tools/commissioning/commissioning.h"

namespace stickslip::emulated {

/// A bench without dynamics: every channel is at its hand's place, and the base follows the drive.
class Hands final : public Wires {
 public:
  double truth(Channel channel, std::int64_t time_ns) override {
    const std::lock_guard hold(mutex_);
    const double time_s = 1e-9 * static_cast<double>(time_ns) - late_s[index_of(channel)];
    double out = pushed[index_of(channel)];
    if (channel == Channel::base_displacement && on_) out += (volts_ - 2.5) / 150.0;
    if (!to_and_fro) return out;
    constexpr std::array hz = {0.9, 2.3};
    for (const double each : hz) {
      const double rate = 2.0 * std::numbers::pi * each;
      const double x = 2e-3 * std::sin(rate * time_s);
      const double v = 2e-3 * rate * std::cos(rate * time_s);
      if (channel == Channel::displacement) out += x;
      if (channel == Channel::velocity) out += v;
      if (channel == Channel::friction_force) out += 400.0 * x;
    }
    return out;
  }
  void drive(double volts, std::int64_t) override {
    const std::lock_guard hold(mutex_);
    volts_ = volts;
  }
  void enable(bool on, std::int64_t) override {
    const std::lock_guard hold(mutex_);
    on_ = on;
    if (on) ever_on = true;
    if (on && when_on) when_on();
  }
  bool amplifier_fault() const override { return fault; }
  bool emergency_stop() const override { return pressed; }
  bool is_on() const {
    const std::lock_guard hold(mutex_);
    return on_;
  }
  void change(const std::function<void(Hands&)>& action) {
    const std::lock_guard hold(mutex_);
    action(*this);
  }

  std::array<double, channel_count> pushed{};
  std::array<double, channel_count> late_s{};
  bool to_and_fro = false;
  std::atomic<bool> pressed = false;
  std::atomic<bool> fault = false;
  bool ever_on = false;
  std::function<void()> when_on;

 private:
  mutable std::mutex mutex_;
  double volts_ = 2.5;
  bool on_ = false;
};

/// Without devices, which a fixture adds, with what is done to them in `actions`.
struct Acceptance : testing::Test {
  struct Action {
    std::string question;  // a part of it
    std::function<void()> act;
    std::string answer;
  };

  Acceptance() {
    durations = {.reading_s = 0.6,
                 .response_s = 3.0,
                 .return_s = 20.0,
                 .motion_s = 3.0,
                 .drive_s = 1.5,
                 .timing_s = 0.5};
    actions = {
        {"displacement: [Enter]", push(Channel::displacement, 3e-3), ""},
        {"velocity: [Enter]", push(Channel::velocity, 0.1), ""},
        {"friction_force: [Enter]", push(Channel::friction_force, 1.0), ""},
        {"base_displacement: [Enter]", push(Channel::base_displacement, 3e-3), ""},
        {"to and fro", [this] { hands.change([](Hands& all) { all.to_and_fro = true; }); }, ""},
        {"press the emergency stop", [this] { hands.pressed = true; }, ""},
        {"release the button", [this] { hands.pressed = false; }, ""},
        {"make the amplifier report", [this] { hands.fault = true; }, ""},
        {"end the amplifier's fault", [this] { hands.fault = false; }, ""},
        {"\"yes\" starts it", {}, "yes"},
    };
    person.show = [this](const std::string& text) {
      shown += text;
      hands_on_fault = hands_on_fault || text.find("(amplifier_fault)") != std::string::npos;
    };
    person.ask = [this](const std::string& question, const std::string&) {
      return answer(question);
    };
  }

  std::function<void()> push(Channel channel, double si) {
    return [this, channel, si] {
      hands.change([&](Hands& all) { all.pushed[index_of(channel)] = si; });
    };
  }

  std::optional<std::string> answer(const std::string& question) {
    if (question.find("unplug") == std::string::npos) {
      hands.change([](Hands& all) {
        all.pushed.fill(0.0);
        all.to_and_fro = false;
      });
    }
    // A host that was too busy to read the lines: they count as active.
    const std::string unread = "The drive was stopped: the emergency stop";
    if (question.find("r repeats") != std::string::npos &&
        shown.rfind(unread) != std::string::npos) {
      shown.clear();
      return "r";
    }
    // A part of a longer name does not count: the longest match does.
    const Action* best = nullptr;
    for (const Action& each : actions) {
      const bool matches = question.find(each.question) != std::string::npos;
      if (matches && (best == nullptr || each.question.size() > best->question.size()))
        best = &each;
    }
    if (best == nullptr) return "";
    if (best->act) best->act();
    return best->answer;
  }

  Action& on(const std::string& question) {
    for (Action& each : actions) {
      if (each.question == question) return each;
    }
    throw std::logic_error("no action for " + question);
  }

  bool accept(const std::vector<std::string>& steps = {}) {
    commissioning::BenchSession session(drivers::make_bench(rig.bench, rig.loop.rate_hz), rig,
                                        stop.get_token());
    return commissioning::commission(session, person, record, {steps}, durations,
                                     [this](const commissioning::Record& now) { kept = now; });
  }

  /// The step, and no other, made on the bench of the test.
  commissioning::StepRecord made(const std::string& step) {
    accept({step});
    const commissioning::StepRecord* found = record.find(step);
    return found == nullptr ? commissioning::StepRecord() : *found;
  }
  void expect_failed(const std::string& step, const std::string& part) {
    const commissioning::StepRecord found = made(step);
    EXPECT_EQ(found.verdict, commissioning::Verdict::failed) << found.text;
    EXPECT_THAT(found.text, testing::HasSubstr(part));
    EXPECT_FALSE(found.remedy.empty());
  }

  Hands hands;
  config::Rig rig;
  commissioning::Durations durations;
  std::vector<Action> actions;
  bool hands_on_fault = false;
  std::string shown;
  commissioning::Person person;
  std::stop_source stop;
  commissioning::Record record;
  commissioning::Record kept;
};

}  // namespace stickslip::emulated
