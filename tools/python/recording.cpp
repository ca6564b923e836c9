// SPDX-License-Identifier: Apache-2.0
#include "tools/python/recording.h"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/spelling.h"
#include "protocol/log_lock.h"
#include "protocol/sha256.h"
#include "tools/files/outputs.h"
#include "tools/files/read_file.h"
#include "tools/python/bindings.h"
#include "tools/python/frame_array.h"
#include "tools/python/interruptible.h"

namespace stickslip::python {

report::Provenance::File RecordingHolder::provenance() const {
  const std::string name = std::filesystem::path(recording.source).filename().string();
  if (!sha256.empty()) return {name, sha256};
  std::ostringstream text;
  protocol::write_csv(recording, text);
  return {name, protocol::sha256_of(text.str())};
}

SharedRecording recording_of(std::vector<Frame> frames, const std::string& source) {
  check_frames(frames, source);
  auto out = std::make_shared<RecordingHolder>();
  out->recording.source = source;
  for (const Frame& frame : frames) out->recording.channels |= frame.valid;
  out->recording.frames = std::move(frames);
  return out;
}

namespace {

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

// Throws InputError; a misspelt name is answered with the one that was meant.
Channel channel_for(const std::string& column, const std::string& source) {
  if (const auto channel = channel_named(column); channel && column == info(*channel).column) {
    return *channel;
  }
  std::vector<std::string> columns;
  std::string list;
  for (const Channel each : all_channels) {
    columns.emplace_back(info(each).column);
    list += (list.empty() ? "" : ", ") + columns.back();
  }
  const std::string meant = physics::nearest(column, columns);
  throw InputError(Problem{source, 0, 0,
                           "there is no channel " + column + "; expected one of " + list +
                               (meant.empty() ? "" : ": did you mean " + meant + "?")});
}

Numbers column_of(const py::handle& values, const std::string& name, const std::string& source) {
  const auto numbers = Numbers::ensure(values);
  if (!numbers) {
    PyErr_Clear();
    throw InputError(Problem{source, 0, 0, name + " is not an array of numbers"});
  }
  if (numbers.ndim() != 1) {
    throw InputError(Problem{source, 0, 0,
                             name + " has " + std::to_string(numbers.ndim()) +
                                 " dimensions; expected one, shape (samples,)"});
  }
  return numbers;
}

std::int64_t nanoseconds(double time_s, std::size_t sample, const std::string& source) {
  constexpr double longest_s = 9.0e9;
  if (std::abs(time_s) < longest_s) return std::llround(time_s * 1.0e9);
  throw InputError(Problem{source, 0, 0,
                           "time_s of sample " + std::to_string(sample) + " is " +
                               physics::number_text(time_s) +
                               "; expected a finite number of seconds, below 9e9"});
}

SharedRecording from_columns(const py::object& time_s, const std::string& source,
                             const py::kwargs& channels) {
  const Numbers time = column_of(time_s, "time_s", source);
  std::vector<Frame> frames(static_cast<std::size_t>(time.size()));
  for (std::size_t i = 0; i < frames.size(); ++i) {
    frames[i].time_ns = nanoseconds(time.at(static_cast<py::ssize_t>(i)), i, source);
    frames[i].sequence = i;
  }
  for (const auto& [key, values] : channels) {
    const auto name = py::cast<std::string>(key);
    const Channel channel = channel_for(name, source);
    const Numbers numbers = column_of(values, name, source);
    if (numbers.size() != time.size()) {
      throw InputError(Problem{source, 0, 0,
                               name + " has " + std::to_string(numbers.size()) +
                                   " values; expected " + std::to_string(time.size()) +
                                   ", one for each time_s"});
    }
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const double value = numbers.at(static_cast<py::ssize_t>(i));
      if (!std::isnan(value)) frames[i].set(channel, value);
    }
  }
  return recording_of(std::move(frames), source);
}

SharedRecording read(const std::filesystem::path& path, const py::object& progress) {
  auto out = std::make_shared<RecordingHolder>();
  run_interruptibly(progress, [&](Work& work) {
    out->recording =
        protocol::read_recording(path, [&work](double done) { work.report("reading", done); });
    out->sha256 = protocol::sha256_of(files::content_of(path));
  });
  if (out->recording.cut_off_bytes > 0) {
    const std::string warning = protocol::cut_off_warning(out->recording);
    if (PyErr_WarnEx(PyExc_UserWarning, warning.c_str(), 1) != 0) throw py::error_already_set();
  }
  return out;
}

void write(const SharedRecording& self, const std::filesystem::path& path, bool force) {
  protocol::require_free_log(path.string());
  const std::vector<std::string> inputs =
      self->sha256.empty() ? std::vector<std::string>{} : std::vector{self->recording.source};
  const py::gil_scoped_release released;
  const files::Outputs outputs("stickslip.Recording.write", inputs, force);
  outputs.write(path.string(), [&](const std::filesystem::path& place) {
    protocol::write_recording(self->recording, place);
  });
}

bool is_complete(const protocol::Recording& recording, Channel channel) {
  for (const Frame& frame : recording.frames) {
    if (!frame.has(channel)) return false;
  }
  return true;
}

// The column of the frames themselves, or a copy where some are not measured.
py::array channel_array(const py::object& self, const std::string& column) {
  const protocol::Recording& recording = py::cast<const RecordingHolder&>(self).recording;
  const Channel channel = channel_for(column, recording.source);
  if (is_complete(recording, channel)) return array_of(recording.frames, self)[column.c_str()];
  py::array_t<double> out(static_cast<py::ssize_t>(recording.frames.size()));
  double* const values = out.mutable_data();
  for (std::size_t i = 0; i < recording.frames.size(); ++i) {
    const Frame& frame = recording.frames[i];
    values[i] = frame.has(channel) ? frame[channel] : std::numeric_limits<double>::quiet_NaN();
  }
  return out;
}

py::array_t<double> times(const RecordingHolder& self) {
  py::array_t<double> out(static_cast<py::ssize_t>(self.recording.frames.size()));
  double* to = out.mutable_data();
  for (const Frame& frame : self.recording.frames) *to++ = frame.time_s();
  return out;
}

py::tuple channels_of(const RecordingHolder& self) {
  py::list out;
  for (const Channel channel : all_channels) {
    if (((self.recording.channels >> index_of(channel)) & 1U) == 0) continue;
    out.append(py::str(info(channel).column.data(), info(channel).column.size()));
  }
  return py::tuple(out);
}

py::dict description_of(const RecordingHolder& self) {
  const protocol::Description& d = self.recording.description;
  py::dict out;
  out["rig"] = d.rig;
  out["started_utc"] = protocol::utc_text(d.started_utc_us);
  out["program"] = d.program;
  out["version"] = d.version;
  out["configuration"] = d.configuration;
  out["model"] = d.model;
  out["calibration"] = d.calibration;
  out["fault_script"] = d.fault_script;
  return out;
}

std::string words_for(const RecordingHolder& self) {
  const auto& frames = self.recording.frames;
  const double length_s = frames.back().time_s() - frames.front().time_s();
  return "<stickslip.Recording " + self.recording.source + ": " +
         physics::counted(frames.size(), "sample") + " over " + physics::number_text(length_s) +
         " s>";
}

constexpr const char* class_doc =
    R"(A recording: samples of the channels of a rig, in SI units, at increasing times.

Recording(time_s, *, source="recording", displacement_m=..., ...) makes one of arrays of shape
(samples,): the times [s], and any of displacement_m [m], velocity_m_s [m/s], friction_force_n [N],
normal_load_n [N], base_displacement_m [m] and drive_force_n [N]. NaN: not measured. The arrays are
copied. `source` names the recording in messages and reports. InputError (a ValueError) names the
array and the sample that cannot be used.

A recording never changes. recording["displacement_m"] is that channel, shape (samples,), in SI
units: a read-only view of the recording's memory where every sample was measured, otherwise a copy
with NaN where it was not.)";

}  // namespace

void bind_recording(py::module_& module) {
  using namespace py::literals;
  py::class_<RecordingHolder, SharedRecording>(module, "Recording", class_doc)
      .def(py::init(&from_columns), "time_s"_a, py::kw_only(), "source"_a = "recording")
      .def_static("read", &read, "path"_a, py::kw_only(), "progress"_a = py::none(),
                  "Reads an LCM event log or a CSV file; its content decides which. Warns of a "
                  "truncated file, whose intact part is read. `progress(step, share)` is called "
                  "with the share read, 0 to 1. InputError has file and line, or byte.")
      .def_static(
          "from_frames",
          [](const py::array& frames, const std::string& source) {
            return recording_of(frames_of(frames, source), source);
          },
          "frames"_a, py::kw_only(), "source"_a = "recording",
          "A recording of records as `frames` has them, shape (samples,): of Live, or changed. "
          "They are copied. Without a field `valid`, NaN is not measured.")
      .def("write", &write, "path"_a, py::kw_only(), "force"_a = false,
           "Writes CSV (.csv) or an LCM event log (.log, .lcm). A file that this did not write is "
           "replaced only with force=True, the recording's own file never.")
      .def("__len__", [](const RecordingHolder& self) { return self.recording.frames.size(); })
      .def("__repr__", &words_for)
      .def("__getitem__", &channel_array, "column"_a)
      .def_property_readonly(
          "frames",
          [](const py::object& self) {
            return array_of(py::cast<const RecordingHolder&>(self).recording.frames, self);
          },
          "The samples as records, shape (samples,): a read-only view of the recording's memory, "
          "not a copy. Fields: time_ns [ns], sequence (a jump is a loss), each channel in SI "
          "units, 0 where it was not measured; valid (bit i: channel i was measured, in the order "
          "of the fields) and age_us, shape (6,): time from the measurement of a channel to "
          "time_ns [us].")
      .def_property_readonly("time_s", &times, "Times of the samples [s], shape (samples,).")
      .def_property_readonly("channels", &channels_of,
                             "Names of the channels that were measured in some sample.")
      .def_property_readonly(
          "period_s",
          [](const RecordingHolder& self) {
            return protocol::median_period_s(self.recording.frames);
          },
          "Median time between samples [s]; 0 with fewer than two.")
      .def_property_readonly(
          "source", [](const RecordingHolder& self) { return self.recording.source; },
          "Its file, or its name.")
      .def_property_readonly("description", &description_of,
                             "The description of a log: rig, started_utc, program, version, and "
                             "the texts configuration, model, calibration and fault_script; empty "
                             "for CSV files and arrays.");
}

}  // namespace stickslip::python
