// SPDX-License-Identifier: Apache-2.0
#include "daemon/realtime.h"

#include <alloca.h>
#include <fcntl.h>
#include <malloc.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>

namespace stickslip::daemon {

Grant lock_memory() {
  Grant grant{"locked memory", false, {}};
  const char* remedy =
      "; to grant it: LimitMEMLOCK=infinity in the systemd unit, or `ulimit -l unlimited`, or "
      "CAP_IPC_LOCK";
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    grant.refusal = std::string("refused by the kernel: ") + std::strerror(errno) + remedy;
    return grant;
  }
  // With a finite limit the lock on future memory turns the next large allocation or thread into a
  // failure. Probe with more than the daemon will ever add; give the lock back if that is refused.
  constexpr std::size_t reserve_bytes = 64UL << 20U;
  void* probe =
      mmap(nullptr, reserve_bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (probe == MAP_FAILED) {
    munlockall();
    rlimit limit{};
    getrlimit(RLIMIT_MEMLOCK, &limit);
    grant.refusal =
        "the limit of " + std::to_string(limit.rlim_cur / 1024) + " KiB is too low" + remedy;
    return grant;
  }
  munmap(probe, reserve_bytes);
  grant.granted = true;
  return grant;
}

Grant make_thread_real_time(int priority) {
  Grant grant{"SCHED_FIFO priority " + std::to_string(priority), false, {}};
  sched_param parameter{};
  parameter.sched_priority = priority;
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter);
  grant.granted = error == 0;
  if (!grant.granted) {
    grant.refusal = std::string("refused by the kernel: ") + std::strerror(error) +
                    "; to grant it: LimitRTPRIO=" + std::to_string(priority) +
                    " in the systemd unit, or `ulimit -r " + std::to_string(priority) +
                    "`, or CAP_SYS_NICE; in a container also a real-time budget of the cgroup";
  }
  return grant;
}

void prefault(std::size_t bytes) {
  constexpr std::size_t page = 4096;
  // Freed memory stays with the process, and large blocks come from the same heap.
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  std::vector<char> heap(bytes);
  volatile char* const on_heap = heap.data();
  for (std::size_t i = 0; i < bytes; i += page) on_heap[i] = 1;
  volatile auto* const on_stack = static_cast<volatile char*>(alloca(bytes));
  for (std::size_t i = 0; i < bytes; i += page) on_stack[i] = 1;
}

std::vector<int> isolated_processors() {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) return {};
  // "2-3,7"
  std::ifstream file("/sys/devices/system/cpu/isolated");
  std::vector<int> out;
  for (std::string part; std::getline(file, part, ',');) {
    int first = 0;
    int last = 0;
    const int found = std::sscanf(part.c_str(), "%d-%d", &first, &last);
    if (found < 1) continue;
    for (int i = first; i <= (found == 2 ? last : first) && i < CPU_SETSIZE; ++i) {
      if (i >= 0 && CPU_ISSET(static_cast<unsigned>(i), &allowed)) out.push_back(i);
    }
  }
  return out;
}

Grant pin_thread(std::optional<int> processor) {
  const std::vector<int> isolated = isolated_processors();
  Grant grant{"a dedicated processor", false, {}};
  if (!processor && isolated.empty()) {
    grant.refusal =
        "this host isolates none; to grant it: isolcpus=N nohz_full=N on the kernel's command "
        "line, or set loop.cpu";
    return grant;
  }
  const int chosen = processor ? *processor : isolated.front();
  grant.request = "processor " + std::to_string(chosen) + " for the loop";
  cpu_set_t set;
  CPU_ZERO(&set);
  if (chosen >= 0 && chosen < CPU_SETSIZE) CPU_SET(static_cast<unsigned>(chosen), &set);
  const int error = pthread_setaffinity_np(pthread_self(), sizeof set, &set);
  grant.granted = error == 0;
  if (!grant.granted) {
    grant.refusal =
        std::string("refused by the kernel: ") + std::strerror(error) +
        "; to grant it: set loop.cpu to an existing processor that CPUAffinity= and the "
        "container allow the daemon";
  }
  return grant;
}

ProcessorLatencyRequest::~ProcessorLatencyRequest() {
  if (file_ >= 0) ::close(file_);
}

Grant ProcessorLatencyRequest::request() {
  Grant grant{"processors kept awake (/dev/cpu_dma_latency)", false, {}};
  file_ = ::open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
  const std::int32_t microseconds = 0;
  if (file_ >= 0 && ::write(file_, &microseconds, sizeof microseconds) == sizeof microseconds) {
    grant.granted = true;
  } else {
    grant.refusal =
        std::string("refused: ") + std::strerror(errno) +
        "; to grant it: DeviceAllow=/dev/cpu_dma_latency rw in the systemd unit and write "
        "permission on that file";
  }
  return grant;
}

std::string text(const std::vector<Grant>& grants) {
  std::string out;
  for (const Grant& grant : grants) {
    out += (out.empty() ? "" : "\n") + grant.request + ": " +
           (grant.granted ? "granted" : "not granted: " + grant.refusal);
  }
  return out;
}

}  // namespace stickslip::daemon
