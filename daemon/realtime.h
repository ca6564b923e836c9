// SPDX-License-Identifier: Apache-2.0
// Real-time privileges of the kernel. Each is requested and the result reported; a refusal comes
// with its remedy and is never fatal.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace stickslip::daemon {

struct Grant {
  std::string request;  ///< "SCHED_FIFO priority 50"
  bool granted = false;
  std::string refusal;  ///< if refused: the reason and the remedy
};

/// Locks the current and future memory of the process. Refused if a limit would let the lock
/// succeed now and make a later allocation fail.
Grant lock_memory();

/// Gives the calling thread a real-time priority (1 to 99). Threads that it starts later inherit
/// it, such as those of a device that is started by the loop's thread.
Grant make_thread_real_time(int priority);

/// Touches memory before the loop needs it: `bytes` of the calling thread's stack and of the heap,
/// which is then kept. Below 1 MiB.
void prefault(std::size_t bytes);

/// Processors that this process may use and that the kernel keeps free of other work (isolcpus=);
/// empty on most hosts.
std::vector<int> isolated_processors();

/// Pins the calling thread to `processor`; if absent, to an isolated one.
Grant pin_thread(std::optional<int> processor);

/// Keeps the processors out of deep sleep states during the lifetime of this object.
class ProcessorLatencyRequest {
 public:
  ProcessorLatencyRequest() = default;
  ProcessorLatencyRequest(const ProcessorLatencyRequest&) = delete;
  ProcessorLatencyRequest& operator=(const ProcessorLatencyRequest&) = delete;
  ~ProcessorLatencyRequest();

  /// By /dev/cpu_dma_latency.
  Grant request();

 private:
  int file_ = -1;
};

/// One line for each grant.
std::string text(const std::vector<Grant>& grants);

}  // namespace stickslip::daemon
