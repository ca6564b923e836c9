// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "observer/kalman_filter.h"
#include "observer/smoother.h"
#include "physics/failure.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/result_units.h"
#include "physics/unsigned_zero.h"
#include "protocol/json_text.h"
#include "protocol/recording.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/recording_input.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/files/outputs.h"
#include "tools/terminal/abilities.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

using observer::FrictionEstimate;
using observer::Quantity;
using physics::number_text;

struct Arguments {
  std::string recording;
  std::string model;
  std::string out;
  std::string json;
};

// Statistics of the estimates over a recording.
struct Summary {
  // Mean weighted by the inverse variance, and range.
  struct Spread {
    double sum = 0.0, weight = 0.0;
    double low = 0.0, high = 0.0;
    void add(double value, double deviation) {
      if (!(deviation > 0.0)) return;
      low = weight > 0.0 ? std::min(low, value) : value;
      high = weight > 0.0 ? std::max(high, value) : value;
      sum += value / (deviation * deviation);
      weight += 1.0 / (deviation * deviation);
    }
    double mean() const { return weight > 0.0 ? sum / weight : 0.0; }
  };
  Spread mu, gamma;
  std::size_t frames = 0, good = 0;
  double sticking = 0.0, slip_squares = 0.0, force_deviations = 0.0;

  void add(const FrictionEstimate& e) {
    ++frames;
    if (!e.valid) return;
    ++good;
    mu.add(e.mu, e.standard_deviation(Quantity::mu));
    gamma.add(e.gamma_per_s, e.standard_deviation(Quantity::gamma));
    sticking += e.sticking;
    slip_squares += e.slip_velocity_m_s * e.slip_velocity_m_s;
    force_deviations += e.standard_deviation(Quantity::friction_force);
  }
  double share(double sum) const { return good > 0 ? sum / static_cast<double>(good) : 0.0; }
};

// The estimates as CSV, one row per frame.
class Table {
 public:
  // Empty: no table; "-": standard output.
  Table(const std::filesystem::path& file, const physics::ResultUnits& units)
      : name_(file.string()), units_(units) {
    if (!name_.empty() && name_ != "-") file_.open(file, std::ios::binary);
  }
  void add(const FrictionEstimate& e) {
    if (name_.empty()) return;
    if (first_) write(header(e));
    first_ = false;
    std::string row;
    append(row, "%.9f", static_cast<double>(e.time_ns) * 1.0e-9);
    for (std::size_t i = 0; i < e.used; ++i) {
      if (!has_value(e.quantities[i])) continue;
      append(row, ",%.9g", value(e, e.quantities[i]));
      append(row, ",%.3g", std::sqrt(std::max(0.0, e.covariance[i][i])));
    }
    append(row, ",%.9g", e.slip_velocity_m_s);
    append(row, ",%.3g", e.slip_velocity_std_m_s);
    append(row, ",%.4f", e.sticking);
    append(row, ",%.4g", e.nis);
    row += e.valid ? ",1\n" : ",0\n";
    write(row);
  }
  void finish() {
    if (!file_.is_open()) return;
    file_.close();
    if (!file_) throw Failure(name_ + ": is incomplete");
  }

 private:
  static void append(std::string& row, const char* format, double number) {
    char text[40];
    std::snprintf(text, sizeof text, format, physics::unsigned_zero(number));
    row += text;
  }
  // An estimate has no field for the deflection of the load cell.
  static bool has_value(Quantity quantity) { return quantity != Quantity::load_cell_deflection; }
  static double value(const FrictionEstimate& e, Quantity quantity) {
    switch (quantity) {
      case Quantity::displacement:
        return e.displacement_m;
      case Quantity::velocity:
        return e.velocity_m_s;
      case Quantity::load_cell_velocity:
        return e.velocity_m_s - e.slip_velocity_m_s;
      case Quantity::theta:
        return e.theta;
      case Quantity::mu:
        return e.mu;
      case Quantity::gamma:
        return e.gamma_per_s;
      case Quantity::normal_load:
        return e.normal_load_n;
      case Quantity::friction_force:
        return e.friction_force_n;
      case Quantity::load_cell_deflection:
        break;
    }
    return 0.0;
  }
  std::string header(const FrictionEstimate& e) const {
    std::string text = units_.column("time_s");
    for (std::size_t i = 0; i < e.used; ++i) {
      if (!has_value(e.quantities[i])) continue;
      const std::string name = units_.column(observer::name_of(e.quantities[i]));
      text += ',' + name + ',' + name + "_std";
    }
    const std::string slip = units_.column("slip_velocity_m_s");
    return text + ',' + slip + ',' + slip + "_std,sticking,nis,good\n";
  }
  void write(const std::string& text) {
    if (file_.is_open()) {
      file_ << text;
    } else {
      std::fwrite(text.data(), 1, text.size(), stdout);
    }
  }

  std::string name_;
  physics::ResultUnits units_;
  std::ofstream file_;
  bool first_ = true;
};

nlohmann::ordered_json spread_json(const Summary::Spread& s) {
  nlohmann::ordered_json out;
  if (s.weight > 0.0) out = {{"mean", s.mean()}, {"low", s.low}, {"high", s.high}};
  return out;
}

// Statistics of the one-step predictions.
struct MeanPerReading {
  double nll = 0.0;
  double nis = 0.0;
};
MeanPerReading mean_of(const observer::PredictionQuality& predicted) {
  const double readings = std::max(1.0, static_cast<double>(predicted.readings));
  return {predicted.negative_log_likelihood / readings, predicted.normalised_squares / readings};
}

nlohmann::ordered_json summary_json(const Summary& summary,
                                    const observer::PredictionQuality& predicted,
                                    const physics::ResultUnits& units) {
  const MeanPerReading mean = mean_of(predicted);
  nlohmann::ordered_json json;
  json["schema"] = 1;
  if (units.dimensionless()) json["dimensionless"] = true;
  json["frames"] = summary.frames;
  json["good_frames"] = summary.good;
  json["mu"] = spread_json(summary.mu);
  json["gamma_per_s"] = spread_json(summary.gamma);
  json["sticking_share"] = summary.share(summary.sticking);
  json["nll_per_reading"] = mean.nll;
  json["nis_per_reading"] = mean.nis;
  json["refused_readings"] = predicted.refused;
  json["restarts"] = predicted.restarts;
  return json;
}

void print_spread(const std::string& name, const Summary::Spread& s) {
  if (!(s.weight > 0.0)) return;
  terminal::print("%s %s, range %s to %s\n", name.c_str(), number_text(s.mean()).c_str(),
                  number_text(s.low).c_str(), number_text(s.high).c_str());
}

void print_summary(const Arguments& arguments, const Summary& summary,
                   const observer::PredictionQuality& predicted,
                   const physics::ResultUnits& units) {
  const MeanPerReading mean = mean_of(predicted);
  terminal::print("%s: %s, %zu with a valid estimate\n", arguments.recording.c_str(),
                  physics::counted(summary.frames, "frame").c_str(), summary.good);
  print_spread("mu", summary.mu);
  print_spread(units.axis("gamma", "1/s"), summary.gamma);
  terminal::print("sticking: %.1f %% of the time\n", 100.0 * summary.share(summary.sticking));
  terminal::print(
      "one-step prediction: NIS %s per reading (1: consistent with the model), negative "
      "log-likelihood %s per reading\n",
      number_text(mean.nis).c_str(), number_text(mean.nll).c_str());
  if (predicted.restarts > 0 || predicted.refused > 0) {
    terminal::print("the filter diverged and restarted %s; %s rejected as outliers\n",
                    physics::counted(predicted.restarts, "time").c_str(),
                    physics::counted(predicted.refused, "reading").c_str());
  }
  if (!arguments.out.empty()) terminal::print("%s written\n", arguments.out.c_str());
}

observer::PredictionQuality estimated(const Arguments& arguments, const physics::Model& model,
                                      const protocol::Recording& recording, Summary& summary,
                                      Table& table) {
  terminal::Progress progress("estimating");
  // No progress bar in a terminal that shows the table.
  if (arguments.out == "-" && terminal::abilities_of(STDOUT_FILENO).terminal) progress.finish();
  return observer::smooth(
      model, protocol::median_period_s(recording.frames), recording.frames,
      [&](const FrictionEstimate& e) {
        summary.add(e);
        table.add(e);
      },
      {}, [&progress](double share) { progress.at(share); });
}

/// Throws InputError where the recording or the model cannot be estimated.
void expect_estimable(const Arguments& arguments, const physics::Model& model,
                      const protocol::Recording& recording) {
  const double period_s = protocol::median_period_s(recording.frames);
  if (!(period_s > 0.0)) {
    throw InputError(Problem{arguments.recording, 0, 0,
                             "holds one sample, hence no sampling period; expected two or more"});
  }
  if (const std::string why = observer::KalmanFilter(model, period_s).unsupported(); !why.empty()) {
    throw InputError(Problem{arguments.model, 0, 0, why});
  }
}

int run(const Arguments& arguments, const Outputs& outputs) {
  const physics::Model model = config::load_model(arguments.model);
  const protocol::Recording recording = recording_from(arguments.recording);
  expect_estimable(arguments, model, recording);
  const physics::ResultUnits units(model);
  Summary summary;
  observer::PredictionQuality predicted;
  const auto estimate_into = [&](const std::filesystem::path& file) {
    Table table(file, units);
    predicted = estimated(arguments, model, recording, summary, table);
    table.finish();
  };
  if (arguments.out.empty()) {
    estimate_into({});
  } else {
    outputs.write(arguments.out, estimate_into);
  }
  outputs.write(arguments.json, Form::json,
                protocol::json_text(summary_json(summary, predicted, units)) + "\n");
  if (arguments.out != "-") print_summary(arguments, summary, predicted, units);
  return 0;
}

}  // namespace

void add_estimate(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "estimate", "Estimate friction, its state, mu, gamma, slip and sticking from a recording");
  add_recording(*command, arguments->recording);
  add_model_option(*command, arguments->model);
  add_output(*command, "--out", arguments->out,
             "Estimates, one row per frame (CSV; -: standard output)");
  add_json_file_option(*command, arguments->json);
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(*command,
           {.examples = {{"Estimate the friction force and state, one row per frame",
                          "stickslip estimate run.log --model amended.toml --out estimates.csv"}},
            .files = {recording_files, model_files},
            .see_also = {"stickslip-evaluate(1)"}});
}

}  // namespace stickslip::commands
