// SPDX-License-Identifier: Apache-2.0
#include <cerrno>

#include "fake_host.h"

namespace stickslip::doctor {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr const char* limits =
    "printf '@stickslip - rtprio 50\\n@stickslip - memlock unlimited\\n' | sudo tee "
    "/etc/security/limits.d/70-stickslip.conf   # then log in again";
const Attempt denied{false, EPERM, "Operation not permitted"};

TEST(RealTimePriorityCheck, DistinguishesTheCausesOfRefusal) {
  FakeHost host;
  const Requirements required = some_requirements();
  EXPECT_THAT(check_real_time_priority(host, required), passes());
  host.prioritised = denied;
  host.priority_limit = 0;
  EXPECT_THAT(check_real_time_priority(host, required),
              AllOf(is(Verdict::fail, "RLIMIT_RTPRIO is 0"), remedied_by(limits)));
  // Root is not refused because of its limits; low ones are reported all the same.
  host.who.root = true;
  EXPECT_THAT(check_real_time_priority(host, required),
              AllOf(is(Verdict::fail, "RLIMIT_RTPRIO is 0"), is(Verdict::fail, "container"),
                    remedied_by("docker run --cap-add SYS_NICE --ulimit rtprio=50 ...")));
  host.who.root = false;
  host.priority_limit = 99;
  EXPECT_THAT(check_real_time_priority(host, required),
              AllOf(is(Verdict::fail, "container"),
                    remedied_by("docker run --cap-add SYS_NICE --ulimit rtprio=50 ...")));
  host.files["/proc/self/cgroup"] = "5:cpu,cpuacct:/user.slice\n0::/user.slice";
  host.files["/sys/fs/cgroup/cpu/user.slice/cpu.rt_runtime_us"] = "0";
  EXPECT_THAT(
      check_real_time_priority(host, required),
      AllOf(is(Verdict::fail, "control group is 0"),
            remedied_by("echo 950000 | sudo tee /sys/fs/cgroup/cpu/user.slice/cpu.rt_runtime_us")));
  Requirements indifferent = required;
  indifferent.real_time = false;
  EXPECT_THAT(check_real_time_priority(host, indifferent),
              AllOf(is(Verdict::note, "not required by the rig"), remedied_by("")));
}

TEST(LockedMemoryCheck, ReportsTheLimit) {
  FakeHost host;
  const Requirements required = some_requirements();
  EXPECT_THAT(check_locked_memory(host, required), passes());
  host.locked = {false, ENOMEM, "Cannot allocate memory"};
  host.memory_limit = 8 << 20;
  EXPECT_THAT(check_locked_memory(host, required),
              AllOf(is(Verdict::fail, "RLIMIT_MEMLOCK is 8192 KiB"), remedied_by(limits)));
  host.memory_limit = -1;
  EXPECT_THAT(check_locked_memory(host, required),
              AllOf(is(Verdict::fail, "Cannot allocate memory"),
                    remedied_by("docker run --cap-add IPC_LOCK --ulimit memlock=-1 ...")));
  Requirements indifferent = required;
  indifferent.real_time = false;
  EXPECT_EQ(check_locked_memory(host, indifferent).verdict, Verdict::note);
}

TEST(ProcessorSleepCheck, RequiresTheLatencyFile) {
  FakeHost host;
  EXPECT_THAT(check_processor_sleep(host), passes());
  host.opened = {false, EACCES, "Permission denied"};
  EXPECT_THAT(check_processor_sleep(host),
              AllOf(is(Verdict::warn, "Permission denied"),
                    remedied_by("sudo chgrp stickslip /dev/cpu_dma_latency && sudo chmod 0660 "
                                "/dev/cpu_dma_latency")));
  host.opened = {false, ENOENT, "No such file or directory"};
  EXPECT_THAT(check_processor_sleep(host), is(Verdict::note, "no /dev/cpu_dma_latency"));
}

TEST(RealTimeShareCheck, RequiresHalfOfTheTime) {
  FakeHost host;
  std::string& runtime = host.files["/proc/sys/kernel/sched_rt_runtime_us"];
  const std::string command =
      "sudo sysctl -w kernel.sched_rt_runtime_us=950000 kernel.sched_rt_period_us=1000000";
  EXPECT_THAT(check_real_time_share(host), AllOf(passes(), is(Verdict::ok, "95 %")));
  runtime = "-1";
  EXPECT_THAT(check_real_time_share(host), passes());
  runtime = "100000";
  EXPECT_THAT(check_real_time_share(host), AllOf(is(Verdict::warn, "10 %"), remedied_by(command)));
  runtime = "0";
  EXPECT_THAT(check_real_time_share(host), AllOf(is(Verdict::fail, "none"), remedied_by(command)));
  host.files.erase("/proc/sys/kernel/sched_rt_runtime_us");
  EXPECT_EQ(check_real_time_share(host).verdict, Verdict::note);
}

TEST(KernelCheck, DistinguishesThePreemptionModels) {
  FakeHost host;
  EXPECT_THAT(check_kernel(host), passes());
  host.files.erase("/sys/kernel/realtime");
  EXPECT_THAT(check_kernel(host), passes());  // its version string contains it as well
  host.running.version = "#1 SMP PREEMPT_DYNAMIC Debian 6.1.76-1";
  host.files["/sys/kernel/debug/sched/preempt"] = "none (voluntary) full";
  EXPECT_THAT(check_kernel(host),
              AllOf(is(Verdict::warn, "PREEMPT_DYNAMIC (voluntary)"),
                    remedied_by("sudo apt-get install linux-image-rt-amd64   # then boot it")));
  host.running = {"6.1", "#1 SMP Debian", "aarch64"};
  host.files.erase("/sys/kernel/debug/sched/preempt");
  EXPECT_THAT(check_kernel(host),
              AllOf(is(Verdict::warn, "no preemption"),
                    remedied_by("sudo apt-get install linux-image-rt-arm64   # then boot it")));
  host.running.version = "#1 SMP PREEMPT Debian";
  EXPECT_THAT(check_kernel(host), is(Verdict::warn, ", PREEMPT:"));
}

TEST(GovernorCheck, RequiresThePerformanceGovernor) {
  FakeHost host;
  EXPECT_THAT(check_governor(host), AllOf(passes(), is(Verdict::ok, "performance on 2")));
  host.files["/sys/devices/system/cpu/cpu1/cpufreq/scaling_governor"] = "powersave";
  EXPECT_THAT(check_governor(host),
              AllOf(is(Verdict::warn, "performance on 1, powersave on 1"),
                    remedied_by("echo performance | sudo tee "
                                "/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor")));
  host.folders.erase("/sys/devices/system/cpu");
  EXPECT_EQ(check_governor(host).verdict, Verdict::note);
}

TEST(IsolatedProcessorsCheck, SuggestsTheLastProcessor) {
  FakeHost host;
  EXPECT_THAT(check_isolated_processors(host), passes());
  host.files["/sys/devices/system/cpu/isolated"] = "";
  EXPECT_THAT(check_isolated_processors(host),
              AllOf(is(Verdict::note, "none"),
                    testing::Field(&Finding::command, HasSubstr("isolcpus=1 nohz_full=1\""))));
  host.folders["/sys/devices/system/cpu"] = {"cpu0"};
  EXPECT_THAT(check_isolated_processors(host),
              AllOf(is(Verdict::note, "one processor"), remedied_by("")));
}

TEST(ClockSourceCheck, RequiresOneWithoutASystemCall) {
  FakeHost host;
  const std::string folder = "/sys/devices/system/clocksource/clocksource0/";
  EXPECT_THAT(check_clock_source(host), passes());
  host.files[folder + "current_clocksource"] = "kvm-clock";
  EXPECT_THAT(check_clock_source(host), passes());
  host.files[folder + "current_clocksource"] = "hpet";
  EXPECT_THAT(check_clock_source(host),
              AllOf(is(Verdict::warn, "hpet"),
                    remedied_by("echo tsc | sudo tee " + folder + "current_clocksource")));
  host.files[folder + "available_clocksource"] = "hpet acpi_pm";
  EXPECT_THAT(
      check_clock_source(host),
      remedied_by("sudo dmesg | grep -i -e clocksource -e tsc   # why the kernel rejected tsc"));
  host.files.erase(folder + "current_clocksource");
  EXPECT_EQ(check_clock_source(host).verdict, Verdict::note);
}

TEST(VirtualMachineCheck, ReportsTheStealTime) {
  FakeHost host;
  EXPECT_THAT(check_virtual_machine(host), passes());
  host.files["/proc/cpuinfo"] = "flags : fpu hypervisor";
  host.files["/sys/class/dmi/id/sys_vendor"] = "QEMU";
  EXPECT_THAT(check_virtual_machine(host),
              AllOf(is(Verdict::note, "one of QEMU"), remedied_by("")));
  host.files["/proc/stat"] = "cpu  10 0 10 880 0 0 0 100 0 0\ncpu0";
  EXPECT_THAT(check_virtual_machine(host),
              AllOf(is(Verdict::warn, "10 % of the time"),
                    remedied_by("vmstat 1 5   # st: assign dedicated processors")));
}

TEST(WakeupCheck, ComparesLatenessWithThePeriodAndSuggestsARemedy) {
  const Requirements required = some_requirements();  // 1 ms
  Wakeups wakeups = FakeHost().woken;
  EXPECT_THAT(check_wakeups(wakeups, required, {}), passes());
  wakeups.longest_ns = 1'200'000;
  const Finding green{"a", Verdict::ok, "", ""};
  const Finding red{"b", Verdict::warn, "", "cure b"};
  const Finding other{"c", Verdict::warn, "", "cure c"};
  EXPECT_THAT(check_wakeups(wakeups, required, {green, red, other}),
              AllOf(is(Verdict::warn, "1200 us (longest of 1000)"), remedied_by("cure b")));
  EXPECT_THAT(check_wakeups(wakeups, required, {green}),
              remedied_by("ps -eo pid,cls,rtprio,pcpu,comm --sort=-pcpu | head"));
  wakeups.p99_ns = 600'000;
  wakeups.real_time = false;
  EXPECT_THAT(check_wakeups(wakeups, required, {red}),
              is(Verdict::fail, "without real-time priority: 8 us (median), 600 us (99 %)"));
  Requirements slow = required;
  slow.rate_hz = 100.0;
  EXPECT_THAT(check_wakeups(wakeups, slow, {red}), passes());
}

TEST(WallClockCheck, RequiresSynchronisation) {
  FakeHost host;
  EXPECT_THAT(check_wall_clock(host), AllOf(passes(), is(Verdict::ok, "at most 1.5 ms")));
  host.wall->synchronised = false;
  EXPECT_THAT(check_wall_clock(host), AllOf(is(Verdict::warn, "not synchronised"),
                                            remedied_by("sudo timedatectl set-ntp true")));
  host.entries.erase("/usr/bin/timedatectl");
  EXPECT_THAT(check_wall_clock(host), remedied_by("sudo apt-get install chrony"));
  host.wall.reset();
  EXPECT_EQ(check_wall_clock(host).verdict, Verdict::note);
}

TEST(ClockStepCheck, DetectsBothDirections) {
  Wakeups wakeups = FakeHost().woken;
  EXPECT_THAT(check_clock_steps(wakeups), passes());
  for (const std::int64_t step : {5'000'000, -5'000'000}) {
    wakeups.clock_step_ns = step;
    EXPECT_THAT(check_clock_steps(wakeups),
                AllOf(is(Verdict::warn, "stepped by 5000 us"),
                      remedied_by("sudo apt-get install chrony   # slews instead")));
  }
}

}  // namespace
}  // namespace stickslip::doctor
