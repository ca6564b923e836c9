// SPDX-License-Identifier: Apache-2.0
// The loop of the daemon on a bench of emulated devices, in a thread of its own.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "daemon/excitation.h"
#include "daemon/ledger.h"
#include "daemon/loop.h"
#include "drivers/driver.h"
#include "tests/emulated/attach/emulated_bus.h"
#include "tests/emulated/attach/host_watch.h"

namespace stickslip::emulated {

/// Cleared, armed and started at once; test hosts may be silent for long.
class LoopOnABench {
 public:
  /// `bench` is closed, and outlives the loop.
  explicit LoopOnABench(drivers::Driver& bench) : bench_(bench) {
    const drivers::Result opened = bench_.open();
    EXPECT_TRUE(opened) << opened.message;
    daemon::LoopSettings settings;
    settings.start_at_once = true;
    settings.live.interlocks.longest_silence_ns = 10'000'000'000;
    config::Excitation shaking;
    shaking.enabled = true;
    shaking.carrier_hz = 3.2;
    shaking.amplitude = 0.009;
    shaking.ramp_s = 0.2;
    loop_ = std::make_unique<daemon::Loop>(bench_, clock_, settings, daemon::Excitation(shaking),
                                           nullptr, ledger_, std::vector<daemon::Stream*>{});
    thread_ = std::jthread([this] { loop_->run(); });
  }
  LoopOnABench(const LoopOnABench&) = delete;
  LoopOnABench& operator=(const LoopOnABench&) = delete;
  ~LoopOnABench() {
    loop_->request_stop();
    loop_->request_stop();
    thread_.join();
    bench_.close();
  }

  daemon::Snapshot now() const { return loop_->snapshot(); }
  bool faulted() const { return now().state == daemon::RigState::faulted; }
  bool moves() const { return now().drive.value != 0.0; }
  std::string cause() const { return now().cause.c_str(); }
  bool ask(daemon::Command::Kind kind) {
    daemon::Command command;
    command.kind = kind;
    return static_cast<bool>(loop_->ask(command));
  }

 private:
  drivers::Driver& bench_;
  drivers::MonotonicHostClock clock_;
  daemon::Ledger ledger_;
  std::unique_ptr<daemon::Loop> loop_;
  std::jthread thread_;
};

/// False after half a minute.
inline bool eventually(const std::function<bool()>& holds) {
  using std::chrono::steady_clock;
  const auto until = steady_clock::now() + std::chrono::seconds(30);
  while (!holds()) {
    if (steady_clock::now() > until) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

}  // namespace stickslip::emulated
