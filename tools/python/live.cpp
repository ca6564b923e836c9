// SPDX-License-Identifier: Apache-2.0
#include <poll.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/lcm_url.h"
#include "physics/failure.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"
#include "tools/python/bindings.h"
#include "tools/python/frame_array.h"
#include "tools/telemetry/lcm_client.h"

namespace stickslip::python {

namespace {

using std::chrono::steady_clock;

std::string url_of(const std::optional<std::string>& asked) {
  const char* const variable = std::getenv("LCM_DEFAULT_URL");
  std::string url = asked ? *asked : variable != nullptr ? variable : protocol::default_url;
  const std::string wrong = config::wrong_with_lcm_url(url);
  if (!wrong.empty()) throw InputError(Problem{"", 0, 0, "LCM URL " + url + ": " + wrong});
  return url;
}

// Blocks of frames as they arrive, and those that were lost.
class Live {
 public:
  explicit Live(const std::optional<std::string>& url) : lcm_(telemetry::join_lcm(url_of(url))) {
    telemetry::listen<&Live::take>(*lcm_, protocol::frames_channel, this);
  }

  // Called by LCM within receive().
  void take(const lcm::ReceiveBuffer* buffer, const std::string&) {
    frame_block_t block;
    const auto* const bytes = static_cast<const std::uint8_t*>(buffer->data);
    std::vector<Frame> frames;
    if (!protocol::decode({bytes, buffer->data_size}, block) ||
        !protocol::from_block(block, frames)) {
      ++malformed_;
      return;
    }
    for (const Frame& frame : frames) {
      // A source that starts anew counts from 0 again.
      if (expected_ && frame.sequence > *expected_) lost_ += frame.sequence - *expected_;
      expected_ = frame.sequence + 1;
    }
    waiting_.insert(waiting_.end(), frames.begin(), frames.end());
  }

  // All frames that wait; otherwise those of the next message. Empty after `until`.
  std::vector<Frame> receive(steady_clock::time_point until) {
    while (true) {
      while (is_readable(std::chrono::milliseconds(0))) {
        if (lcm_or_closed().handle() < 0) throw Failure("LCM does not deliver its messages");
      }
      if (!waiting_.empty()) return std::exchange(waiting_, {});
      const auto left = until - steady_clock::now();
      if (left <= steady_clock::duration::zero()) return {};
      is_readable(std::min(std::chrono::ceil<std::chrono::milliseconds>(left), longest_wait));
      const py::gil_scoped_acquire lock;
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
  }

  void close() { lcm_.reset(); }
  bool is_closed() const { return lcm_ == nullptr; }
  std::uint64_t lost() const { return lost_; }
  std::uint64_t malformed() const { return malformed_; }

 private:
  static constexpr std::chrono::milliseconds longest_wait{100};  // before signals are handled

  lcm::LCM& lcm_or_closed() {
    if (lcm_ == nullptr) throw InputError(Problem{"", 0, 0, "this Live is closed"});
    return *lcm_;
  }
  bool is_readable(std::chrono::milliseconds wait) {
    pollfd file{lcm_or_closed().getFileno(), POLLIN, 0};
    return ::poll(&file, 1, static_cast<int>(wait.count())) > 0;
  }

  std::unique_ptr<lcm::LCM> lcm_;
  std::vector<Frame> waiting_;
  std::optional<std::uint64_t> expected_;  // sequence number of the next frame
  std::uint64_t lost_ = 0;
  std::uint64_t malformed_ = 0;
};

py::object receive(Live& self, const std::optional<double>& timeout_s) {
  std::vector<Frame> frames;
  {
    const py::gil_scoped_release released;
    const auto now = steady_clock::now();
    const bool only_waiting = timeout_s && *timeout_s <= 0.0;
    frames = self.receive(only_waiting ? now : telemetry::after(now, timeout_s.value_or(0.0)));
  }
  if (frames.empty()) return py::none();
  return array_of(std::move(frames));
}

constexpr const char* class_doc =
    R"(The frames that a rig publishes over LCM, as they arrive.

    with stickslip.Live() as live:
        for frames in live:                # until Ctrl-C
            print(frames["displacement_m"][-1])

`url`: of LCM; LCM_DEFAULT_URL, or the group that stays on this host, if None. Arrays are records as
Recording.frames has them; stickslip.Recording.from_frames(numpy.concatenate(list_of_them)) is a
recording. Other threads of Python run while it waits. One thread at a time may use it.)";

}  // namespace

void bind_live(py::module_& module) {
  using namespace py::literals;
  py::class_<Live>(module, "Live", class_doc)
      .def(py::init<const std::optional<std::string>&>(), "url"_a = py::none(),
           py::call_guard<py::gil_scoped_release>())
      .def("receive", &receive, "timeout_s"_a = py::none(),
           "All frames that have arrived since the last call, shape (frames,), or the next ones; "
           "None if none arrive in time [s]. Without a timeout it waits until Ctrl-C.")
      .def("close", &Live::close, "Leaves LCM; a second call does nothing.")
      .def("__enter__", [](const py::object& self) { return self; })
      .def("__exit__", [](Live& self, const py::args&) { self.close(); })
      .def("__iter__", [](const py::object& self) { return self; })
      .def("__next__",
           [](Live& self) {
             if (self.is_closed()) throw py::stop_iteration();
             return receive(self, std::nullopt);
           })
      .def_property_readonly("lost", &Live::lost,
                             "Frames missing so far, by gaps in their sequence numbers.")
      .def_property_readonly("malformed", &Live::malformed,
                             "Messages so far that were damaged, hence not used.");
}

}  // namespace stickslip::python
