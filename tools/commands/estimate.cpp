// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "physics/failure.h"
#include "physics/number_text.h"
#include "physics/result_units.h"
#include "physics/unsigned_zero.h"
#include "protocol/json_text.h"
#include "protocol/recording.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/recording_input.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/files/outputs.h"
#include "tools/processing/estimation.h"
#include "tools/terminal/abilities.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

using observer::FrictionEstimate;
using physics::number_text;
using processing::EstimateSummary;

struct Arguments {
  std::string recording;
  std::string model;
  std::string out;
  std::string json;
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
    if (columns_.empty()) {
      columns_ = processing::columns_of(e, units_);
      write(header());
    }
    const std::vector<double> values = processing::row_of(e);
    std::string row;
    for (std::size_t i = 0; i < values.size(); ++i) {
      char text[40];
      std::snprintf(text, sizeof text, columns_[i].format, physics::unsigned_zero(values[i]));
      row.append(i > 0 ? "," : "").append(text);
    }
    write(row + '\n');
  }
  void finish() {
    if (!file_.is_open()) return;
    file_.close();
    if (!file_) throw Failure(name_ + ": is incomplete");
  }

 private:
  std::string header() const {
    std::string text;
    for (const auto& column : columns_) text += (text.empty() ? "" : ",") + column.name;
    return text + '\n';
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
  std::vector<processing::EstimateColumn> columns_;  // empty before the first estimate
};

void print_spread(const std::string& name, const EstimateSummary::Spread& s) {
  if (!(s.weight > 0.0)) return;
  terminal::print("%s %s, range %s to %s\n", name.c_str(), number_text(s.mean()).c_str(),
                  number_text(s.low).c_str(), number_text(s.high).c_str());
}

void print_summary(const Arguments& arguments, const EstimateSummary& summary,
                   const physics::ResultUnits& units) {
  const observer::PredictionQuality& predicted = summary.predicted;
  terminal::print("%s: %s, %zu with a valid estimate\n", arguments.recording.c_str(),
                  physics::counted(summary.frames, "frame").c_str(), summary.good);
  print_spread("mu", summary.mu);
  print_spread(units.axis("gamma", "1/s"), summary.gamma);
  terminal::print("sticking: %.1f %% of the time\n", 100.0 * summary.sticking_share());
  terminal::print(
      "one-step prediction: NIS %s per reading (1: consistent with the model), negative "
      "log-likelihood %s per reading\n",
      number_text(summary.nis_per_reading()).c_str(),
      number_text(summary.nll_per_reading()).c_str());
  if (predicted.restarts > 0 || predicted.refused > 0) {
    terminal::print("the filter diverged and restarted %s; %s rejected as outliers\n",
                    physics::counted(predicted.restarts, "time").c_str(),
                    physics::counted(predicted.refused, "reading").c_str());
  }
  if (!arguments.out.empty()) terminal::print("%s written\n", arguments.out.c_str());
}

int run(const Arguments& arguments, const Outputs& outputs) {
  const physics::Model model = config::load_model(arguments.model);
  const protocol::Recording recording = recording_from(arguments.recording);
  const physics::ResultUnits units(model);
  EstimateSummary summary;
  const auto estimate_into = [&](const std::filesystem::path& file) {
    Table table(file, units);
    terminal::Progress progress("estimating");
    // No progress bar in a terminal that shows the table.
    if (arguments.out == "-" && terminal::abilities_of(STDOUT_FILENO).terminal) progress.finish();
    summary = processing::estimate(
        recording, model, arguments.model, [&](const FrictionEstimate& e) { table.add(e); },
        [&progress](double share) { progress.at(share); });
    table.finish();
  };
  if (arguments.out.empty()) {
    estimate_into({});
  } else {
    outputs.write(arguments.out, estimate_into);
  }
  outputs.write(arguments.json, Form::json,
                protocol::json_text(processing::summary_json(summary, model)) + "\n");
  if (arguments.out != "-") print_summary(arguments, summary, units);
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
                          "stickslip estimate run.log --model mended.toml --out estimates.csv"}},
            .files = {recording_files, model_files},
            .see_also = {"stickslip-evaluate(1)"}});
}

}  // namespace stickslip::commands
