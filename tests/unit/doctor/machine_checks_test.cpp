#include <cerrno>

#include "fake_host.h"

namespace stickslip::doctor {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr const char* limits =
    "printf '@stickslip - rtprio 50\\n@stickslip - memlock unlimited\\n' | sudo tee "
    "/etc/security/limits.d/70-stickslip.conf   # then log in anew";
const Tried denied{false, EPERM, "Operation not permitted"};

TEST(RealTimePriorityCheck, TellsWhichGateIsClosed) {
  FakeHost host;
  const Needs needs = some_needs();
  EXPECT_THAT(check_real_time_priority(host, needs), is_green());
  host.prioritised = denied;
  host.priority_limit = 0;
  EXPECT_THAT(check_real_time_priority(host, needs),
              AllOf(is(Verdict::fail, "RLIMIT_RTPRIO is 0"), mended_by(limits)));
  // What refuses root is not its limits; that they are low is told all the same.
  host.who.root = true;
  EXPECT_THAT(check_real_time_priority(host, needs),
              AllOf(is(Verdict::fail, "RLIMIT_RTPRIO is 0"), is(Verdict::fail, "container"),
                    mended_by("docker run --cap-add SYS_NICE --ulimit rtprio=50 ...")));
  host.who.root = false;
  host.priority_limit = 99;
  EXPECT_THAT(check_real_time_priority(host, needs),
              AllOf(is(Verdict::fail, "container"),
                    mended_by("docker run --cap-add SYS_NICE --ulimit rtprio=50 ...")));
  host.files["/proc/self/cgroup"] = "5:cpu,cpuacct:/user.slice\n0::/user.slice";
  host.files["/sys/fs/cgroup/cpu/user.slice/cpu.rt_runtime_us"] = "0";
  EXPECT_THAT(
      check_real_time_priority(host, needs),
      AllOf(is(Verdict::fail, "control group is 0"),
            mended_by("echo 950000 | sudo tee /sys/fs/cgroup/cpu/user.slice/cpu.rt_runtime_us")));
  Needs indifferent = needs;
  indifferent.real_time = false;
  EXPECT_THAT(check_real_time_priority(host, indifferent),
              AllOf(is(Verdict::note, "does not ask for it"), mended_by("")));
}

TEST(LockedMemoryCheck, TellsTheLimit) {
  FakeHost host;
  const Needs needs = some_needs();
  EXPECT_THAT(check_locked_memory(host, needs), is_green());
  host.locked = {false, ENOMEM, "Cannot allocate memory"};
  host.memory_limit = 8 << 20;
  EXPECT_THAT(check_locked_memory(host, needs),
              AllOf(is(Verdict::fail, "RLIMIT_MEMLOCK is 8192 KiB"), mended_by(limits)));
  host.memory_limit = -1;
  EXPECT_THAT(check_locked_memory(host, needs),
              AllOf(is(Verdict::fail, "Cannot allocate memory"),
                    mended_by("docker run --cap-add IPC_LOCK --ulimit memlock=-1 ...")));
  Needs indifferent = needs;
  indifferent.real_time = false;
  EXPECT_EQ(check_locked_memory(host, indifferent).verdict, Verdict::note);
}

TEST(ProcessorSleepCheck, WantsTheLatencyFileOpen) {
  FakeHost host;
  EXPECT_THAT(check_processor_sleep(host), is_green());
  host.opened = {false, EACCES, "Permission denied"};
  EXPECT_THAT(check_processor_sleep(host),
              AllOf(is(Verdict::warn, "Permission denied"),
                    mended_by("sudo chgrp stickslip /dev/cpu_dma_latency && sudo chmod 0660 "
                              "/dev/cpu_dma_latency")));
  host.opened = {false, ENOENT, "No such file or directory"};
  EXPECT_THAT(check_processor_sleep(host), is(Verdict::note, "there is no"));
}

TEST(RealTimeShareCheck, WantsMostOfTheTime) {
  FakeHost host;
  std::string& runtime = host.files["/proc/sys/kernel/sched_rt_runtime_us"];
  const std::string command =
      "sudo sysctl -w kernel.sched_rt_runtime_us=950000 kernel.sched_rt_period_us=1000000";
  EXPECT_THAT(check_real_time_share(host), AllOf(is_green(), is(Verdict::ok, "95 %")));
  runtime = "-1";
  EXPECT_THAT(check_real_time_share(host), is_green());
  runtime = "100000";
  EXPECT_THAT(check_real_time_share(host), AllOf(is(Verdict::warn, "10 %"), mended_by(command)));
  runtime = "0";
  EXPECT_THAT(check_real_time_share(host), AllOf(is(Verdict::fail, "none"), mended_by(command)));
  host.files.erase("/proc/sys/kernel/sched_rt_runtime_us");
  EXPECT_EQ(check_real_time_share(host).verdict, Verdict::note);
}

TEST(KernelCheck, KnowsTheModelsOfPreemption) {
  FakeHost host;
  EXPECT_THAT(check_kernel(host), is_green());
  host.files.erase("/sys/kernel/realtime");
  EXPECT_THAT(check_kernel(host), is_green());  // its version says so too
  host.running.version = "#1 SMP PREEMPT_DYNAMIC Debian 6.1.76-1";
  host.files["/sys/kernel/debug/sched/preempt"] = "none (voluntary) full";
  EXPECT_THAT(check_kernel(host),
              AllOf(is(Verdict::warn, "PREEMPT_DYNAMIC (voluntary)"),
                    mended_by("sudo apt-get install linux-image-rt-amd64   # then start it")));
  host.running = {"6.1", "#1 SMP Debian", "aarch64"};
  host.files.erase("/sys/kernel/debug/sched/preempt");
  EXPECT_THAT(check_kernel(host),
              AllOf(is(Verdict::warn, "no preemption"),
                    mended_by("sudo apt-get install linux-image-rt-arm64   # then start it")));
  host.running.version = "#1 SMP PREEMPT Debian";
  EXPECT_THAT(check_kernel(host), is(Verdict::warn, ", PREEMPT:"));
}

TEST(GovernorCheck, WantsEveryProcessorFast) {
  FakeHost host;
  EXPECT_THAT(check_governor(host), AllOf(is_green(), is(Verdict::ok, "performance on 2")));
  host.files["/sys/devices/system/cpu/cpu1/cpufreq/scaling_governor"] = "powersave";
  EXPECT_THAT(check_governor(host),
              AllOf(is(Verdict::warn, "performance on 1, powersave on 1"),
                    mended_by("echo performance | sudo tee "
                              "/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor")));
  host.folders.erase("/sys/devices/system/cpu");
  EXPECT_EQ(check_governor(host).verdict, Verdict::note);
}

TEST(IsolatedProcessorsCheck, OffersTheLastOne) {
  FakeHost host;
  EXPECT_THAT(check_isolated_processors(host), is_green());
  host.files["/sys/devices/system/cpu/isolated"] = "";
  EXPECT_THAT(check_isolated_processors(host),
              AllOf(is(Verdict::note, "none"),
                    testing::Field(&Finding::command, HasSubstr("isolcpus=1 nohz_full=1\""))));
  host.folders["/sys/devices/system/cpu"] = {"cpu0"};
  EXPECT_THAT(check_isolated_processors(host),
              AllOf(is(Verdict::note, "one processor"), mended_by("")));
}

TEST(ClockSourceCheck, WantsOneWithoutASystemCall) {
  FakeHost host;
  const std::string folder = "/sys/devices/system/clocksource/clocksource0/";
  EXPECT_THAT(check_clock_source(host), is_green());
  host.files[folder + "current_clocksource"] = "kvm-clock";
  EXPECT_THAT(check_clock_source(host), is_green());
  host.files[folder + "current_clocksource"] = "hpet";
  EXPECT_THAT(check_clock_source(host),
              AllOf(is(Verdict::warn, "hpet"),
                    mended_by("echo tsc | sudo tee " + folder + "current_clocksource")));
  host.files[folder + "available_clocksource"] = "hpet acpi_pm";
  EXPECT_THAT(
      check_clock_source(host),
      mended_by("sudo dmesg | grep -i -e clocksource -e tsc   # why the kernel gave tsc up"));
  host.files.erase(folder + "current_clocksource");
  EXPECT_EQ(check_clock_source(host).verdict, Verdict::note);
}

TEST(VirtualMachineCheck, CountsWhatItsHostTook) {
  FakeHost host;
  EXPECT_THAT(check_virtual_machine(host), is_green());
  host.files["/proc/cpuinfo"] = "flags : fpu hypervisor";
  host.files["/sys/class/dmi/id/sys_vendor"] = "QEMU";
  EXPECT_THAT(check_virtual_machine(host), AllOf(is(Verdict::note, "one of QEMU"), mended_by("")));
  host.files["/proc/stat"] = "cpu  10 0 10 880 0 0 0 100 0 0\ncpu0";
  EXPECT_THAT(check_virtual_machine(host),
              AllOf(is(Verdict::warn, "10 % of the time"),
                    mended_by("vmstat 1 5   # st: give the machine processors of its own")));
}

TEST(WakeupCheck, HoldsLatenessAgainstThePeriodAndNamesTheLikelyCure) {
  const Needs needs = some_needs();  // 1 ms
  Wakeups wakeups = FakeHost().woken;
  EXPECT_THAT(check_wakeups(wakeups, needs, {}), is_green());
  wakeups.longest_ns = 1'200'000;
  const Finding green{"a", Verdict::ok, "", ""};
  const Finding red{"b", Verdict::warn, "", "cure b"};
  const Finding other{"c", Verdict::warn, "", "cure c"};
  EXPECT_THAT(check_wakeups(wakeups, needs, {green, red, other}),
              AllOf(is(Verdict::warn, "1200 us (longest of 1000)"), mended_by("cure b")));
  EXPECT_THAT(check_wakeups(wakeups, needs, {green}),
              mended_by("ps -eo pid,cls,rtprio,pcpu,comm --sort=-pcpu | head"));
  wakeups.p99_ns = 600'000;
  wakeups.real_time = false;
  EXPECT_THAT(check_wakeups(wakeups, needs, {red}),
              is(Verdict::fail, "without real-time priority: 8 us (median), 600 us (99 %)"));
  Needs slow = needs;
  slow.rate_hz = 100.0;
  EXPECT_THAT(check_wakeups(wakeups, slow, {red}), is_green());
}

TEST(WallClockCheck, WantsItSynchronised) {
  FakeHost host;
  EXPECT_THAT(check_wall_clock(host), AllOf(is_green(), is(Verdict::ok, "at most 1.5 ms")));
  host.wall->synchronised = false;
  EXPECT_THAT(check_wall_clock(host), AllOf(is(Verdict::warn, "not synchronised"),
                                            mended_by("sudo timedatectl set-ntp true")));
  host.entries.erase("/usr/bin/timedatectl");
  EXPECT_THAT(check_wall_clock(host), mended_by("sudo apt-get install chrony"));
  host.wall.reset();
  EXPECT_EQ(check_wall_clock(host).verdict, Verdict::note);
}

TEST(ClockStepCheck, SeesThemInBothDirections) {
  Wakeups wakeups = FakeHost().woken;
  EXPECT_THAT(check_clock_steps(wakeups), is_green());
  for (const std::int64_t step : {5'000'000, -5'000'000}) {
    wakeups.clock_step_ns = step;
    EXPECT_THAT(check_clock_steps(wakeups),
                AllOf(is(Verdict::warn, "moved by 5000 us"),
                      mended_by("sudo apt-get install chrony   # slews instead")));
  }
}

}  // namespace
}  // namespace stickslip::doctor
