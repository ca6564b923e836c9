#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "config/model_file.h"
#include "physics/effects/number_text.h"
#include "physics/problem.h"
#include "protocol/recording.h"
#include "tools/command.h"
#include "tools/diagnose/report.h"
#include "tools/diagnose/score.h"
#include "tools/option_checks.h"
#include "tools/parallel/for_each.h"
#include "tools/write_file.h"

namespace stickslip::tools {

namespace {

struct Arguments {
  std::string recording;
  std::string model;
  std::string json;
  double horizon_s = 0.0;
  bool free_run = false;
  int jobs = 0;
};

// Parameters stay as the model says: what is uncertain is taken at its value.
physics::Model as_stated(physics::Model model) {
  for (const physics::NamedParameter& named : physics::parameters_of(model))
    named.parameter->sigma = 0.0;
  return model;
}

int run(const Arguments& arguments) {
  using namespace diagnosis;
  expect_writable(arguments.json);
  const physics::Model model = as_stated(config::load_model(arguments.model));
  const protocol::Recording recording = protocol::read_recording(arguments.recording);
  std::vector<Experiment> experiments{make_experiment(recording, model)};
  Experiment& e = experiments.front();
  const double horizon_s =
      arguments.horizon_s > 0.0 ? arguments.horizon_s : default_horizon_s(model, e);
  cut_windows(e, model, horizon_s);
  if (e.windows.empty()) {
    throw InputError(Problem{arguments.recording, 0, 0,
                             "is too short for a prediction window of " +
                                 physics::number_text(horizon_s) + " s: give a smaller --horizon"});
  }
  const Hypothesis hypothesis(model);
  Task task;
  task.experiments = experiments;
  task.sigma = noise_sigma(experiments);
  task.threads = parallel::threads_for(arguments.jobs);
  for (std::size_t w = 0; w < e.windows.size(); ++w) task.windows.push_back({0, w});
  const Score result = score(task, hypothesis, {});

  nlohmann::ordered_json json;
  json["schema"] = 1;
  json["fit"] = score_json(result, true);
  json["horizon_s"] = horizon_s;
  json["free_run"] = nullptr;
  if (arguments.free_run)
    json["free_run"] = free_run_json(diagnosis::free_run(task, hypothesis, {}));
  if (!arguments.json.empty()) write_file(arguments.json, json.dump(2) + "\n");

  std::printf("chi-squared per sample %s over %zu windows of %s s (1: only noise is left)\n",
              physics::number_text(result.chi2_per_sample).c_str(), e.windows.size(),
              physics::number_text(horizon_s).c_str());
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (!result.rmse[c]) continue;
    std::printf(
        "%s: prediction error %s %s, %s of its standard deviation\n",
        std::string(channel_table[c].stem).c_str(), physics::number_text(*result.rmse[c]).c_str(),
        std::string(channel_table[c].unit).c_str(), physics::number_text(*result.nrmse[c]).c_str());
  }
  if (arguments.free_run) {
    for (const auto& [name, value] : json["free_run"]["rmse"].items()) {
      std::printf("free run, %s: %s\n", name.c_str(),
                  physics::number_text(value.get<double>()).c_str());
    }
  }
  return 0;
}

}  // namespace

void add_evaluate(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("evaluate", "Score a model on a recording; no parameter is fitted");
  command->add_option("recording", arguments->recording, "Recording (CSV or LCM log)")
      ->required()
      ->type_name("RECORDING");
  command->add_option("--model", arguments->model, "Model (TOML)")->required();
  command->add_option("--json", arguments->json, "Write the scores as JSON");
  command->add_option("--horizon", arguments->horizon_s, "Length of a prediction [s]")
      ->check(positive_number());
  command->add_flag("--free-run", arguments->free_run,
                    "Also simulate once from the first state to the end");
  command->add_option("--jobs", arguments->jobs, "Threads (0: as many as there are cores)")
      ->check(number_of_threads());
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stickslip::tools
