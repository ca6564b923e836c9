// SPDX-License-Identifier: Apache-2.0
// Timing of the loop.
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <map>
#include <sstream>

#include "tools/doctor/examination.h"

namespace stickslip::doctor {

namespace {

constexpr int loop_priority = 50;  // as requested by the daemon

std::string microseconds(std::int64_t ns) { return std::to_string((ns + 500) / 1000); }

/// Limits of a login session; the daemon's unit sets its own.
constexpr const char* limits_command =
    "printf '@stickslip - rtprio 50\\n@stickslip - memlock unlimited\\n' | sudo tee "
    "/etc/security/limits.d/70-stickslip.conf   # then log in again";

/// File with the real-time budget of this process's control group (version 1) if that budget is 0;
/// empty otherwise.
std::string empty_budget(const Host& host) {
  std::istringstream groups(host.read("/proc/self/cgroup").value_or(""));
  for (std::string line; std::getline(groups, line);) {
    const auto first = line.find(':');
    const auto second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = ',' + line.substr(first + 1, second - first - 1) + ',';
    if (controllers.find(",cpu,") == std::string::npos) continue;
    const std::string path = line.substr(second + 1);
    std::string file = "/sys/fs/cgroup/cpu" + (path == "/" ? "" : path) + "/cpu.rt_runtime_us";
    if (host.read(file) == "0") return file;
  }
  return {};
}

/// Numbers of the processors: "0", "1", ...
std::vector<std::string> processors(const Host& host) {
  std::vector<std::string> out;
  for (const std::string& name : host.names_in("/sys/devices/system/cpu")) {
    const bool is_one = name.size() > 3 && name.starts_with("cpu") &&
                        name.find_first_not_of("0123456789", 3) == std::string::npos;
    if (is_one) out.push_back(name.substr(3));
  }
  return out;
}

bool has_word(const std::string& text, const std::string& word) {
  std::istringstream words(text);
  for (std::string each; words >> each;) {
    if (each == word) return true;
  }
  return false;
}

/// Share of processor time taken by the hypervisor since boot; 0 if unknown.
double steal_share(const Host& host) {
  std::istringstream line(host.read("/proc/stat").value_or(""));
  std::string name;
  line >> name;
  if (name != "cpu") return 0.0;
  // user nice system idle iowait irq softirq steal
  double sum = 0.0;
  double value = 0.0;
  double steal = 0.0;
  for (int i = 0; i < 8 && line >> value; ++i) {
    sum += value;
    if (i == 7) steal = value;
  }
  return sum > 0.0 ? steal / sum : 0.0;
}

}  // namespace

Finding check_real_time_priority(const Host& host, const Requirements& required) {
  const std::string check = "real-time priority";
  const Attempt attempt = host.take_real_time_priority(loop_priority);
  const std::string request = "SCHED_FIFO " + std::to_string(loop_priority);
  if (attempt.done) return {check, Verdict::ok, request + " is granted", ""};
  std::string found = request + " is refused: " + attempt.reason;
  const std::int64_t limit = host.limit(Limit::real_time_priority);
  const bool limited = limit >= 0 && limit < loop_priority;
  std::string command;
  if (const std::string budget = empty_budget(host); !budget.empty()) {
    found += ", the budget of its control group is 0";
    command = "echo 950000 | sudo tee " + budget;
  } else {
    found +=
        limited ? ", RLIMIT_RTPRIO is " + std::to_string(limit) : ", although the limits permit it";
    if (limited && !host.caller().root) {
      command = limits_command;
    } else {  // limits do not apply to root, except in a restricted container
      found += ": a container without CAP_SYS_NICE, or a kernel with CONFIG_RT_GROUP_SCHED";
      command = "docker run --cap-add SYS_NICE --ulimit rtprio=50 ...";
    }
  }
  if (!required.real_time) return {check, Verdict::note, found + "; not required by the rig", ""};
  return {check, Verdict::fail, found, command};
}

Finding check_locked_memory(const Host& host, const Requirements& required) {
  const std::string check = "locked memory";
  const Attempt attempt = host.lock_memory();
  if (attempt.done) return {check, Verdict::ok, "mlockall is granted", ""};
  std::string found = "mlockall is refused: " + attempt.reason;
  const std::int64_t limit = host.limit(Limit::locked_memory);
  if (limit >= 0) found += ", RLIMIT_MEMLOCK is " + std::to_string(limit / 1024) + " KiB";
  if (!required.real_time) return {check, Verdict::note, found + "; not required by the rig", ""};
  const bool limited = limit >= 0 && !host.caller().root;
  return {check, Verdict::fail, found,
          limited ? limits_command : "docker run --cap-add IPC_LOCK --ulimit memlock=-1 ..."};
}

Finding check_processor_sleep(const Host& host) {
  const std::string check = "processor sleep";
  const std::string file = "/dev/cpu_dma_latency";
  const Attempt attempt = host.open_for_writing(file);
  if (attempt.done)
    return {check, Verdict::ok, file + " can be opened: deep sleep can be disabled", ""};
  if (attempt.error == ENOENT) {
    return {check, Verdict::note,
            "no " + file + ": processor sleep states are not controlled by this machine", ""};
  }
  return {
      check, Verdict::warn,
      file + " cannot be opened: " + attempt.reason + "; waking from deep sleep takes about 100 us",
      "sudo chgrp stickslip " + file + " && sudo chmod 0660 " + file};
}

Finding check_real_time_share(const Host& host) {
  const std::string check = "real-time share";
  const auto runtime = host.read("/proc/sys/kernel/sched_rt_runtime_us");
  const auto period = host.read("/proc/sys/kernel/sched_rt_period_us");
  if (!runtime || !period) {
    return {check, Verdict::note, "kernel.sched_rt_runtime_us cannot be read", ""};
  }
  const double share = std::atof(runtime->c_str()) / std::max(1.0, std::atof(period->c_str()));
  const std::string command =
      "sudo sysctl -w kernel.sched_rt_runtime_us=950000 kernel.sched_rt_period_us=1000000";
  if (*runtime == "-1")
    return {check, Verdict::ok, "real-time threads may use all of the time", ""};
  const std::string found =
      "real-time threads may use " + short_number(100.0 * share) + " % of the time";
  if (share <= 0.0) return {check, Verdict::fail, found + ": none is granted", command};
  if (share < 0.5) return {check, Verdict::warn, found, command};
  return {check, Verdict::ok, found, ""};
}

Finding check_kernel(const Host& host) {
  const std::string check = "kernel";
  const Kernel kernel = host.kernel();
  const auto version_has = [&kernel](const char* word) {
    return kernel.version.find(word) != std::string::npos;
  };
  if (host.read("/sys/kernel/realtime") == "1" || version_has("PREEMPT_RT")) {
    return {check, Verdict::ok, kernel.release + ", PREEMPT_RT", ""};
  }
  const bool arm = kernel.machine == "aarch64";
  const std::string install = "sudo apt-get install linux-image-rt-" +
                              std::string(arm ? "arm64" : "amd64") + "   # then boot it";
  std::string model = version_has("PREEMPT_DYNAMIC") ? "PREEMPT_DYNAMIC"
                      : version_has("PREEMPT")       ? "PREEMPT"
                                                     : "no preemption in the kernel";
  // "none voluntary (full)": the active model is in parentheses. Readable by root.
  if (const auto modes = host.read("/sys/kernel/debug/sched/preempt")) {
    const auto open = modes->find('(');
    const auto close = modes->find(')', open);
    if (open != std::string::npos && close != std::string::npos) {
      const std::string mode = modes->substr(open + 1, close - open - 1);
      model += " (" + mode + ")";
    }
  }
  return {check, Verdict::warn,
          kernel.release + ", " + model + ": under load, wake-ups may be late by a millisecond",
          install};
}

Finding check_governor(const Host& host) {
  const std::string check = "frequency governor";
  std::map<std::string, int> governors;
  for (const std::string& processor : processors(host)) {
    const auto governor =
        host.read("/sys/devices/system/cpu/cpu" + processor + "/cpufreq/scaling_governor");
    if (governor) ++governors[*governor];
  }
  if (governors.empty()) {
    return {check, Verdict::note, "none: the processor frequency is not controlled by this machine",
            ""};
  }
  std::string found;
  for (const auto& [name, count] : governors) {
    found += (found.empty() ? "" : ", ") + name + " on " + std::to_string(count);
  }
  if (governors.size() == 1 && governors.contains("performance"))
    return {check, Verdict::ok, found, ""};
  return {check, Verdict::warn, found + ": a low clock frequency delays wake-ups and work",
          "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"};
}

Finding check_isolated_processors(const Host& host) {
  const std::string check = "isolated processors";
  const std::string isolated = host.read("/sys/devices/system/cpu/isolated").value_or("");
  if (!isolated.empty()) {
    return {check, Verdict::ok, isolated + ": CPUAffinity= of the unit puts the daemon there", ""};
  }
  int last = 0;
  for (const std::string& processor : processors(host))
    last = std::max(last, std::atoi(processor.c_str()));
  if (last == 0) return {check, Verdict::note, "none: there is one processor", ""};
  const std::string cpu = std::to_string(last);
  return {check, Verdict::note, "none: other threads may share the processor of the loop",
          "echo 'GRUB_CMDLINE_LINUX_DEFAULT=\"$GRUB_CMDLINE_LINUX_DEFAULT isolcpus=" + cpu +
              " nohz_full=" + cpu +
              "\"' | sudo tee /etc/default/grub.d/70-stickslip.cfg && sudo update-grub   # then "
              "reboot"};
}

Finding check_clock_source(const Host& host) {
  const std::string check = "clock source";
  const std::filesystem::path folder = "/sys/devices/system/clocksource/clocksource0";
  const auto current = host.read(folder / "current_clocksource");
  if (!current) return {check, Verdict::note, "cannot be read", ""};
  for (const char* fast : {"tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page"}) {
    if (*current == fast)
      return {check, Verdict::ok, *current + ": read without a system call", ""};
  }
  const std::string available = host.read(folder / "available_clocksource").value_or("");
  return {check, Verdict::warn, *current + ": every clock reading is a system call",
          has_word(available, "tsc")
              ? "echo tsc | sudo tee " + (folder / "current_clocksource").string()
              : "sudo dmesg | grep -i -e clocksource -e tsc   # why the kernel rejected tsc"};
}

Finding check_virtual_machine(const Host& host) {
  const std::string check = "virtual machine";
  const std::string flags = host.read("/proc/cpuinfo").value_or("");
  const std::string vendor = host.read("/sys/class/dmi/id/sys_vendor").value_or("");
  if (!has_word(flags, "hypervisor"))
    return {check, Verdict::ok, "none: the processors are physical", ""};
  const double share = steal_share(host);
  const std::string found = (vendor.empty() ? std::string("one") : "one of " + vendor) +
                            ": the hypervisor may take the processors away, " +
                            short_number(100.0 * share) + " % of the time since boot";
  if (share < 0.01) return {check, Verdict::note, found, ""};
  return {check, Verdict::warn, found, "vmstat 1 5   # st: assign dedicated processors"};
}

Finding check_wakeups(const Wakeups& wakeups, const Requirements& required,
                      const std::vector<Finding>& causes) {
  const std::string check = "wake-up latency";
  const std::string found =
      "at " + short_number(required.rate_hz) + " Hz " + (wakeups.real_time ? "with" : "without") +
      " real-time priority: " + microseconds(wakeups.p50_ns) + " us (median), " +
      microseconds(wakeups.p99_ns) + " us (99 %), " + microseconds(wakeups.longest_ns) +
      " us (longest of " + std::to_string(wakeups.count) + ")";
  const auto period = required.period_ns();
  const bool often = static_cast<double>(wakeups.p99_ns) >= 0.5 * period;
  const bool once = static_cast<double>(wakeups.longest_ns) >= period;
  if (!often && !once) return {check, Verdict::ok, found, ""};
  std::string command = "ps -eo pid,cls,rtprio,pcpu,comm --sort=-pcpu | head";
  for (const Finding& cause : causes) {
    if (cause.command.empty()) continue;
    command = cause.command;
    break;
  }
  return {check, often ? Verdict::fail : Verdict::warn,
          found + (often ? ": no margin within the period" : ": a cycle would have been skipped"),
          command};
}

Finding check_wall_clock(const Host& host) {
  const std::string check = "wall clock";
  const auto clock = host.wall_clock();
  const std::string command = host.entry_at("/usr/bin/timedatectl").exists()
                                  ? "sudo timedatectl set-ntp true"
                                  : "sudo apt-get install chrony";
  if (!clock)
    return {check, Verdict::note, "the kernel does not report whether it is synchronised", ""};
  if (!clock->synchronised) {
    return {check, Verdict::warn,
            "is not synchronised: recordings of two hosts cannot be compared in time", command};
  }
  return {check, Verdict::ok,
          "synchronised, off by at most " +
              short_number(static_cast<double>(clock->error_us) * 1e-3) + " ms",
          ""};
}

Finding check_clock_steps(const Wakeups& wakeups) {
  const std::string check = "clock steps";
  constexpr double step_ns = 1e6;
  const std::string size =
      short_number(std::abs(static_cast<double>(wakeups.clock_step_ns)) * 1e-3) + " us";
  if (std::abs(static_cast<double>(wakeups.clock_step_ns)) < step_ns) {
    return {check, Verdict::ok, "none during the checks: the wall clock deviated by " + size, ""};
  }
  return {check, Verdict::warn,
          "the wall clock stepped by " + size +
              " during the checks; frames use a clock that does not step",
          "sudo apt-get install chrony   # slews instead"};
}

}  // namespace stickslip::doctor
