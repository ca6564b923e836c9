// `stickslip bifurcation`: bifurcation diagrams of a model.
#include "tools/dynamics/bifurcation.h"
#include "tools/command_line/shared_options.h"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "diagnosis/parallel/for_each.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "tools/command_line/drive_options.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/commands/commands.h"
#include "tools/files/outputs.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

struct Arguments {
  std::shared_ptr<DriveOptions> drive = std::make_shared<DriveOptions>();
  std::string over;
  double from = 0.0;
  double to = 0.0;
  int values = 200;
  int periods = 100;
  bool exponents = false;
  int jobs = 0;
  std::string out = "-";
};

DriveOptions::Swept swept_quantity(const std::string& path) {
  using Swept = DriveOptions::Swept;
  if (path == "drive.frequency_hz") return Swept::frequency;
  if (path == "drive.amplitude_m" || path == "drive.acceleration_m_s2") return Swept::strength;
  return Swept::nothing;
}

/// Throws InputError if the model does not have the swept parameter.
void check_parameter(const Arguments& arguments, const physics::Model& model) {
  const auto paths = dynamics::bifurcation_paths(model);
  if (std::find(paths.begin(), paths.end(), arguments.over) != paths.end()) return;
  std::string known;
  for (const std::string& path : paths) known += (known.empty() ? "" : ", ") + path;
  throw InputError(
      Problem{arguments.drive->model, 0, 0,
              "has no parameter \"" + arguments.over + "\"; expected one of " + known});
}

/// Values of the parameter, equally spaced. Throws InputError if the model refuses one of them.
std::vector<double> swept_values(const Arguments& arguments, const physics::Model& model) {
  std::vector<double> values;
  for (int i = 0; i < arguments.values; ++i) {
    const double share =
        arguments.values > 1 ? static_cast<double>(i) / (arguments.values - 1) : 0.0;
    values.push_back(arguments.from + share * (arguments.to - arguments.from));
  }
  for (const double value : values) {
    const std::string reason = dynamics::refusal(model, arguments.over, value);
    if (!reason.empty()) {
      throw InputError(
          Problem{"--from, --to", 0, 0,
                  arguments.over + " = " + physics::number_text(value) + ": " + reason});
    }
  }
  return values;
}

template <class Columns>
std::string table_of(const Columns& columns, bool with_exponents) {
  std::string table = "value,displacement_m,velocity_m_s";
  table += with_exponents ? ",exponent_per_s\n" : "\n";
  char line[160];
  for (const auto& column : columns) {
    for (const dynamics::Point& point : column.section) {
      std::snprintf(line, sizeof line, "%.9g,%.9g,%.9g", column.value, point.x(), point.v());
      table += line;
      if (with_exponents) {
        std::snprintf(line, sizeof line, ",%.6g", column.exponent_per_s);
        table += line;
      }
      table += '\n';
    }
  }
  return table;
}

int run(const Arguments& arguments, const Outputs& outputs) {
  const physics::Model model = config::load_model(arguments.drive->model);
  const dynamics::Drive drive = arguments.drive->drive(model, swept_quantity(arguments.over));
  check_parameter(arguments, model);
  dynamics::BifurcationOptions options;
  options.portrait = arguments.drive->portrait();
  options.portrait.periods = arguments.periods;
  options.with_exponents = arguments.exponents;
  if (model.oscillator.excitation == physics::Excitation::base) {
    options.base_amplitude_m = arguments.drive->amplitude;
  }
  options.threads = parallel::threads_for(arguments.jobs);
  const std::vector<double> values = swept_values(arguments, model);
  terminal::Progress progress(std::to_string(values.size()) + " values of " + arguments.over);
  options.progress = [&progress](std::size_t done, std::size_t all) { progress.at(done, all); };
  const auto columns = dynamics::bifurcation(model, drive, arguments.over, values, options);
  progress.finish();
  outputs.write(arguments.out, Form::plain, table_of(columns, arguments.exponents));
  return 0;
}

}  // namespace

void add_bifurcation(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "bifurcation", "Compute Poincare sections over the values of one parameter");
  add_drive_options(*command, arguments->drive);
  command
      ->add_option(
          "--over", arguments->over,
          "Parameter: drive.amplitude_m, drive.acceleration_m_s2, drive.frequency_hz, or a "
          "parameter of the model (friction.mu, normal_load.load_n, ...)")
      ->required();
  command->add_option("--from", arguments->from, "First value")->check(finite_number())->required();
  command->add_option("--to", arguments->to, "Last value")->check(finite_number())->required();
  command->add_option("--values", arguments->values, "Number of values")
      ->check(whole_number(1, 1000000))
      ->capture_default_str();
  command->add_option("--periods", arguments->periods, "Points per value")
      ->check(whole_number(1, 1000000))
      ->capture_default_str();
  command->add_flag("--exponents", arguments->exponents, "Add the largest Lyapunov exponent");
  add_jobs_option(*command, arguments->jobs);
  add_output(*command, "--out", arguments->out, "Table to write (CSV; -: standard output)")
      ->capture_default_str();
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(*command,
           {.examples = {{"Sweep the amplitude of the drive",
                          "stickslip bifurcation --model config/models/motivational.toml "
                          "--frequency-hz 4.2 --over drive.amplitude_m --from 0.006 --to 0.012 "
                          "--out diagram.csv"}},
            .files = {model_files},
            .see_also = {"stickslip-poincare(1)", "stickslip-lyapunov(1)"}});
}

}  // namespace stickslip::commands
