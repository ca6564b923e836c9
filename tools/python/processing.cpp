// SPDX-License-Identifier: Apache-2.0
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "diagnosis/bootstrap.h"
#include "diagnosis/diagnosis.h"
#include "diagnosis/evaluation.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/report/html.h"
#include "diagnosis/report/json.h"
#include "diagnosis/report/text.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/json_text.h"
#include "protocol/spread_frames.h"
#include "tools/processing/estimation.h"
#include "tools/processing/evaluation_json.h"
#include "tools/processing/simulation.h"
#include "tools/python/bindings.h"
#include "tools/python/interruptible.h"
#include "tools/python/model.h"
#include "tools/python/recording.h"

namespace stickslip::python {

namespace {

// Throws ValueError as the command line refuses its options.
void check_options(int jobs, const std::optional<double>& horizon_s) {
  if (jobs < 0 || jobs > 1024) {
    throw py::value_error("jobs is " + std::to_string(jobs) +
                          "; expected 0 (one per core) to 1024");
  }
  if (horizon_s && !(std::isfinite(*horizon_s) && *horizon_s > 0.0)) {
    throw py::value_error("horizon_s is " + physics::number_text(*horizon_s) +
                          "; expected a finite number of seconds above 0");
  }
}

SharedRecording simulate(const ModelHolder& model, const SharedRecording& drive, std::uint64_t seed,
                         bool noise, const py::object& progress) {
  auto out = std::make_shared<RecordingHolder>();
  const ModelHolder kept = model;
  run_interruptibly(progress, [&](Work& work) {
    physics::SimulationOptions options;
    options.seed = seed;
    options.noise = noise;
    out->recording =
        processing::simulated(kept.model, kept.source, drive->recording, options,
                              [&work](double done) { work.report("simulating", done); });
  });
  out->recording.source = "simulated";
  return out;
}

std::string evaluate(const SharedRecording& recording, const ModelHolder& model,
                     std::optional<double> horizon_s, bool free_run, int jobs,
                     const py::object& progress) {
  check_options(jobs, horizon_s);
  const ModelHolder kept = model;
  std::string out;
  run_interruptibly(progress, [&](Work& work) {
    diagnosis::EvaluationOptions options;
    options.horizon_s = horizon_s;
    options.free_run = free_run;
    options.threads = parallel::threads_for(jobs);
    options.stop = work.stop();
    options.progress = [&work](double done) { work.report("predicting", done); };
    const diagnosis::Evaluation done =
        diagnosis::evaluate(recording->recording, kept.model, options);
    out = protocol::json_text(processing::evaluation_json(done, kept.model));
  });
  return out;
}

// The columns of the estimates as a dictionary of arrays, and their summary as JSON.
py::tuple estimate(const SharedRecording& recording, const ModelHolder& model,
                   const py::object& progress) {
  const ModelHolder kept = model;
  const physics::ResultUnits units(kept.model);
  std::vector<processing::EstimateColumn> columns;
  std::vector<std::vector<double>> values;
  std::string summary;
  run_interruptibly(progress, [&](Work& work) {
    const auto take = [&](const observer::FrictionEstimate& each) {
      if (columns.empty()) {
        columns = processing::columns_of(each, units);
        values.resize(columns.size());
      }
      const std::vector<double> row = processing::row_of(each);
      for (std::size_t i = 0; i < row.size(); ++i) values[i].push_back(row[i]);
    };
    const processing::EstimateSummary done =
        processing::estimate(recording->recording, kept.model, kept.source, take,
                             [&work](double share) { work.report("estimating", share); });
    summary = protocol::json_text(processing::summary_json(done, kept.model));
  });
  py::dict table;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    table[py::str(columns[i].name)] =
        py::array_t<double>(static_cast<py::ssize_t>(values[i].size()), values[i].data());
  }
  return py::make_tuple(table, summary);
}

// As the command line reads it: of a long recording, blocks spread over it.
protocol::Recording shortened(const protocol::Recording& recording, std::size_t most) {
  protocol::Recording out = recording;
  if (recording.frames.size() <= most) return out;
  protocol::SpreadFrames spread(most);
  for (const Frame& frame : recording.frames) spread.add(frame);
  spread.finish(out);
  return out;
}

struct DiagnosisOptions {
  std::uint64_t seed = 1;
  int jobs = 0;
  std::optional<double> horizon_s;
  double false_alarm_rate = diagnosis::Criteria{}.false_alarm_rate;
  std::size_t bootstrap = 0;
  bool html = false;
};

report::Provenance provenance_of(const std::vector<SharedRecording>& recordings,
                                 const ModelHolder& model, const DiagnosisOptions& options) {
  std::vector<report::Provenance::File> files;
  for (const SharedRecording& each : recordings) files.push_back(each->provenance());
  report::Provenance out = report::provenance_of(files, model.provenance(), options.seed);
  report::add_horizon(out, options.horizon_s);
  report::add_false_alarm_rate(out, options.false_alarm_rate);
  if (options.bootstrap > 0) out.command += " --bootstrap " + std::to_string(options.bootstrap);
  return out;
}

struct DiagnosisTexts {
  std::string json;
  std::string text;
  std::optional<std::string> html;
  ModelHolder model;
};

DiagnosisTexts diagnosed(const std::vector<SharedRecording>& recordings, const ModelHolder& model,
                         const DiagnosisOptions& asked, Work& work) {
  std::vector<protocol::Recording> read;
  for (const SharedRecording& each : recordings) {
    read.push_back(shortened(each->recording, diagnosis::most_frames / recordings.size()));
  }
  diagnosis::Options options;
  options.seed = asked.seed;
  options.threads = parallel::threads_for(asked.jobs);
  options.horizon_s = asked.horizon_s;
  options.criteria.false_alarm_rate = asked.false_alarm_rate;
  options.evidence = asked.html;
  options.stop = work.stop();
  options.progress = [&work](const std::string& step, double done) { work.report(step, done); };
  diagnosis::Diagnosis result = diagnosis::diagnose(read, model.model, options);
  if (asked.bootstrap > 0) {
    result.false_alarms =
        diagnosis::false_alarms(read, model.model, result, asked.bootstrap, options);
  }
  report::Provenance provenance = provenance_of(recordings, model, asked);
  DiagnosisTexts out;
  out.json = protocol::json_text(report::report_json(result, provenance));
  out.text = report::report_text(result);
  out.model = {result.model, "augmented model", {}};
  if (asked.html) {
    provenance.augmented_model = config::model_text(result.model);
    out.html = report::report_html(result, provenance);
  }
  return out;
}

py::tuple diagnose(const std::vector<SharedRecording>& recordings, const ModelHolder& model,
                   std::uint64_t seed, int jobs, std::optional<double> horizon_s,
                   double false_alarm_rate, std::size_t bootstrap, bool html,
                   const py::object& progress) {
  check_options(jobs, horizon_s);
  if (!(false_alarm_rate >= 1.0e-9 && false_alarm_rate < 1.0)) {
    throw py::value_error("false_alarm_rate is " + physics::number_text(false_alarm_rate) +
                          "; expected a number from 1e-9 to below 1");
  }
  if (recordings.empty()) throw py::value_error("no recording; expected one or more of one rig");
  const ModelHolder kept = model;
  DiagnosisTexts out;
  run_interruptibly(progress, [&](Work& work) {
    out = diagnosed(recordings, kept, {seed, jobs, horizon_s, false_alarm_rate, bootstrap, html},
                    work);
  });
  return py::make_tuple(out.json, out.text, out.html, out.model);
}

}  // namespace

void bind_processing(py::module_& module) {
  using namespace py::literals;
  module.def("simulate", &simulate, "model"_a, "drive"_a, "seed"_a, "noise"_a, "progress"_a);
  module.def("evaluate", &evaluate, "recording"_a, "model"_a, "horizon_s"_a, "free_run"_a, "jobs"_a,
             "progress"_a);
  module.def("estimate", &estimate, "recording"_a, "model"_a, "progress"_a);
  module.def("diagnose", &diagnose, "recordings"_a, "model"_a, "seed"_a, "jobs"_a, "horizon_s"_a,
             "false_alarm_rate"_a, "bootstrap"_a, "html"_a, "progress"_a);
}

}  // namespace stickslip::python
