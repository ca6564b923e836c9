// SPDX-License-Identifier: Apache-2.0
#include "daemon/device_supervisor.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <thread>
#include <vector>

#include "daemon/realtime.h"
#include "tests/unit/daemon/fakes.h"

namespace stickslip::daemon {
namespace {

/// The processors that the calling thread may use.
int processors() {
  cpu_set_t set;
  CPU_ZERO(&set);
  return sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 0;
}

int first_processor() {
  cpu_set_t set;
  CPU_ZERO(&set);
  sched_getaffinity(0, sizeof set, &set);
  int first = 0;
  while (CPU_ISSET(static_cast<unsigned>(first), &set) == 0) ++first;
  return first;
}

/// A board whose driver starts a thread for the transfers.
class Threaded final : public drivers::Driver {
 public:
  drivers::Result open() override {
    opened_on = processors();
    return {};
  }
  drivers::Result start() override {
    std::thread([this] { events_on.push_back(processors()); }).join();
    return {};
  }
  drivers::Result read(Frame&) override { return {drivers::Outcome::lost, "unplugged"}; }
  drivers::Result write(const drivers::Actuation&) override { return {}; }
  void stop() noexcept override {}
  void close() noexcept override {}
  const drivers::Description& description() const override { return description_; }

  int opened_on = 0;
  std::vector<int> events_on;

 private:
  drivers::Description description_;
};

TEST(DeviceSupervisor, ARestartedDeviceGetsThreadsWithTheSameScheduling) {
  const int all = processors();
  if (all < 2) GTEST_SKIP() << "one processor: pinned threads do not differ from others";
  const auto schedule = [] { ASSERT_TRUE(pin_thread(first_processor()).granted); };
  Threaded driver;
  test::FakeClock clock;
  Ledger ledger;
  Loop loop(driver, clock, {}, Excitation(config::Excitation{}), nullptr, ledger, {});
  std::thread([&] {
    schedule();
    ASSERT_TRUE(loop.begin());
    loop.wait();
    ASSERT_TRUE(loop.cycle());
  }).join();
  ASSERT_TRUE(loop.device_lost());
  ASSERT_TRUE(DeviceSupervisor::try_to_restore(driver, loop, schedule));
  EXPECT_EQ(driver.events_on, (std::vector<int>{1, 1}));
  // Threads that a device starts when it is opened, such as those of gauges, need no scheduling.
  EXPECT_EQ(driver.opened_on, all);
  EXPECT_EQ(processors(), all);
}

}  // namespace
}  // namespace stickslip::daemon
