// What the kernel grants to a loop that must be on time. Everything is tried, nothing is guessed,
// and a refusal comes with its cure; none is fatal.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace stickslip::daemon {

/// One wish and what became of it.
struct Grant {
  std::string wish;  ///< "SCHED_FIFO priority 50"
  bool granted = false;
  std::string words;  ///< where refused: why, and how to grant it
};

/// Locks the present and future memory of the process. Refused where a limit would let it succeed
/// now and make a later allocation fail.
Grant lock_memory();

/// Gives the calling thread a real-time priority (1 to 99). The threads that it starts later
/// inherit it: those of a device that is started in the loop's own thread shall, others shall not.
Grant make_thread_real_time(int priority);

/// Touches the memory that the loop will use, while nobody waits for it: `bytes` of the calling
/// thread's stack, and of the heap, which is then kept and not given back. Below 1 MiB.
void prefault(std::size_t bytes);

/// The processors that the kernel keeps other work away from (isolcpus=), of those that this
/// process may use; empty on most hosts.
std::vector<int> isolated_processors();

/// Keeps the calling thread on `processor`; on an isolated one, if there is any, where nothing is
/// said.
Grant pin_thread(std::optional<int> processor);

/// Keeps the processors out of deep sleep states for as long as this object lives.
class ProcessorLatencyRequest {
 public:
  ProcessorLatencyRequest() = default;
  ProcessorLatencyRequest(const ProcessorLatencyRequest&) = delete;
  ProcessorLatencyRequest& operator=(const ProcessorLatencyRequest&) = delete;
  ~ProcessorLatencyRequest();

  /// Asks through /dev/cpu_dma_latency.
  Grant request();

 private:
  int file_ = -1;
};

/// One line for each grant, for a person.
std::string text(const std::vector<Grant>& grants);

}  // namespace stickslip::daemon
