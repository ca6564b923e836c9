// SPDX-License-Identifier: Apache-2.0
// Work without Python's lock that Ctrl-C ends, and whose progress Python may follow.
#pragma once

#include <pybind11/pybind11.h>

#include <condition_variable>
#include <functional>
#include <mutex>
#include <stop_token>
#include <string>

namespace stickslip::python {

/// The state of work that its own threads and the caller share.
class Work {
 public:
  /// Once requested, the work should end with diagnosis::Interrupted.
  std::stop_token stop() const { return stop_.get_token(); }

  /// The current step and the completed share of the work, 0 to 1; from any thread. Throws
  /// diagnosis::Interrupted if the work should end.
  void report(const std::string& step, double done);

 private:
  friend void run_interruptibly(const pybind11::object& progress,
                                const std::function<void(Work&)>& work);

  struct Step {
    std::string name;
    double done = 0.0;
    bool is_new = false;
  };
  void end();
  bool ends_soon();
  Step latest();

  std::stop_source stop_;
  std::mutex mutex_;
  std::condition_variable ended_changed_;
  bool ended_ = false;
  Step step_;
};

/// Runs `work` in a thread of its own, without Python's lock. Meanwhile the calling thread, which
/// holds the lock, handles Python's signals and calls `progress(step, share)` with the latest step
/// unless it is None; an exception of either stops the work and is thrown once it has ended.
/// Otherwise rethrows what the work threw.
void run_interruptibly(const pybind11::object& progress, const std::function<void(Work&)>& work);

}  // namespace stickslip::python
