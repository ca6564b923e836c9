// SPDX-License-Identifier: Apache-2.0
#include "tools/python/frame_array.h"

#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>

#include "physics/number_text.h"
#include "physics/problem.h"

namespace stickslip::python {

namespace py = pybind11;

namespace {

constexpr std::size_t value_offset = offsetof(Frame, value);

[[noreturn]] void refuse(const std::string& name, const std::string& message) {
  throw InputError(Problem{name, 0, 0, message});
}

// A field of the array as numbers of one type; empty where there is none.
template <class Number>
py::array_t<Number> field(const py::array& array, const char* column) {
  if (!array.dtype().attr("names").contains(column)) return {};
  return py::array_t<Number, py::array::c_style | py::array::forcecast>(array[column]);
}

}  // namespace

py::dtype frame_dtype() {
  py::list names, formats, offsets;
  const auto add = [&](std::string_view name, const char* format, std::size_t offset) {
    names.append(py::str(name.data(), name.size()));
    formats.append(format);
    offsets.append(offset);
  };
  add("time_ns", "i8", offsetof(Frame, time_ns));
  add("sequence", "u8", offsetof(Frame, sequence));
  for (const Channel channel : all_channels) {
    add(info(channel).column, "f8", value_offset + index_of(channel) * sizeof(double));
  }
  add("valid", "u1", offsetof(Frame, valid));
  add("age_us", "(6,)i4", offsetof(Frame, age_us));
  return {names, formats, offsets, static_cast<py::ssize_t>(sizeof(Frame))};
}

py::array array_of(const std::vector<Frame>& frames, const py::object& owner) {
  py::array out(frame_dtype(), {static_cast<py::ssize_t>(frames.size())},
                {static_cast<py::ssize_t>(sizeof(Frame))}, frames.data(), owner);
  out.attr("setflags")(py::arg("write") = false);
  return out;
}

py::array array_of(std::vector<Frame> frames) {
  auto kept = std::make_unique<std::vector<Frame>>(std::move(frames));
  const std::vector<Frame>& there = *kept;
  const py::capsule owner(kept.release(), [](void* memory) {
    const std::unique_ptr<std::vector<Frame>> freed(static_cast<std::vector<Frame>*>(memory));
  });
  return array_of(there, owner);
}

std::vector<Frame> frames_of(const py::array& array, const std::string& name) {
  if (array.ndim() != 1 || array.dtype().attr("names").is_none() ||
      !array.dtype().attr("names").contains("time_ns")) {
    refuse(name,
           "is an array of another kind; expected one dimension of records with a field "
           "time_ns, as Recording.frames has them");
  }
  const auto time = field<std::int64_t>(array, "time_ns");
  const auto sequence = field<std::uint64_t>(array, "sequence");
  const auto valid = field<std::uint8_t>(array, "valid");
  std::vector<Frame> frames(static_cast<std::size_t>(array.size()));
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const auto at = static_cast<py::ssize_t>(i);
    frames[i].time_ns = time.at(at);
    frames[i].sequence = sequence.size() > 0 ? sequence.at(at) : i;
  }
  if (const auto age = field<std::int32_t>(array, "age_us"); age.size() > 0) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      for (std::size_t c = 0; c < channel_count; ++c) {
        frames[i].age_us[c] = age.at(static_cast<py::ssize_t>(i), static_cast<py::ssize_t>(c));
      }
    }
  }
  for (const Channel channel : all_channels) {
    const auto values = field<double>(array, info(channel).column.data());
    if (values.size() == 0) continue;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const auto at = static_cast<py::ssize_t>(i);
      const bool measured = valid.size() == 0 || ((valid.at(at) >> index_of(channel)) & 1U) != 0;
      if (measured && !std::isnan(values.at(at))) frames[i].set(channel, values.at(at));
    }
  }
  return frames;
}

void check_frames(const std::vector<Frame>& frames, const std::string& name) {
  if (frames.empty()) refuse(name, "holds no sample");
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (i > 0 && frames[i].time_ns <= frames[i - 1].time_ns) {
      refuse(name, "the time of sample " + std::to_string(i) + ", " +
                       physics::number_text(frames[i].time_s()) +
                       " s, is not after that of the sample before, " +
                       physics::number_text(frames[i - 1].time_s()) + " s");
    }
    for (const Channel channel : all_channels) {
      if (!frames[i].has(channel) || std::isfinite(frames[i][channel])) continue;
      refuse(name, std::string(info(channel).column) + " of sample " + std::to_string(i) +
                       " is infinite; expected a finite number, or nan where it was not measured");
    }
  }
}

}  // namespace stickslip::python
