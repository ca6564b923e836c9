// SPDX-License-Identifier: Apache-2.0
#include "tools/python/interruptible.h"

#include <chrono>
#include <exception>
#include <thread>

#include "diagnosis/shooting.h"

namespace stickslip::python {

namespace py = pybind11;

namespace {

constexpr std::chrono::milliseconds poll_interval{50};

}  // namespace

void Work::report(const std::string& step, double done) {
  if (stop_.stop_requested()) throw diagnosis::Interrupted();
  const std::scoped_lock lock(mutex_);
  step_ = {step, done, true};
}

void Work::end() {
  const std::scoped_lock lock(mutex_);
  ended_ = true;
  ended_changed_.notify_all();
}

bool Work::ends_soon() {
  std::unique_lock lock(mutex_);
  return ended_changed_.wait_for(lock, poll_interval, [this] { return ended_; });
}

Work::Step Work::latest() {
  const std::scoped_lock lock(mutex_);
  Step out = step_;
  step_.is_new = false;
  return out;
}

void run_interruptibly(const py::object& progress, const std::function<void(Work&)>& work) {
  Work shared;
  std::exception_ptr failure;
  std::exception_ptr interruption;
  const auto poll = [&] {
    const py::gil_scoped_acquire lock;
    try {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      const Work::Step step = shared.latest();
      if (step.is_new && !progress.is_none()) progress(step.name, step.done);
    } catch (const py::error_already_set&) {
      interruption = std::current_exception();
      shared.stop_.request_stop();
    }
  };
  {
    const py::gil_scoped_release released;
    const std::jthread thread([&] {
      try {
        work(shared);
      } catch (...) {
        failure = std::current_exception();
      }
      shared.end();
    });
    while (!shared.ends_soon() && !interruption) poll();
  }
  if (!interruption) {
    const Work::Step step = shared.latest();
    if (step.is_new && !progress.is_none() && !failure) progress(step.name, step.done);
  }
  if (interruption) std::rethrow_exception(interruption);
  if (failure) std::rethrow_exception(failure);
}

}  // namespace stickslip::python
