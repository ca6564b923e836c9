// SPDX-License-Identifier: Apache-2.0
// `stickslip bifurcation`: bifurcation diagrams of a model.
#include "tools/dynamics/bifurcation.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "config/key.h"
#include "config/model_file.h"
#include "diagnosis/parallel/for_each.h"
#include "physics/catalogue.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/result_units.h"
#include "tools/command_line/drive_options.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/figures/bifurcation_picture.h"
#include "tools/files/outputs.h"
#include "tools/files/read_file.h"
#include "tools/files/temporary_folder.h"
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
  std::string svg;
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

/// The unit of a parameter that a diagram can be drawn over; "1" where it has none.
std::string unit_of(const std::string& path, const physics::Model& model) {
  if (path == "drive.frequency_hz") return "Hz";
  if (path == "drive.amplitude_m") return "m";
  if (path == "drive.acceleration_m_s2") return "m/s2";
  for (const config::Key& key : config::model_keys()) {
    if (key.path == path && !key.unit.empty()) return std::string(key.unit);
  }
  for (const physics::Term& term : model.terms) {
    const physics::Effect* effect = physics::effect_of(term);
    if (effect == nullptr) continue;
    for (const physics::ParameterCard& parameter : effect->card().parameters) {
      if (path == physics::path_of(term) + "." + std::string(parameter.name)) {
        return std::string(parameter.unit);
      }
    }
  }
  return "1";
}

using Columns = std::vector<dynamics::BifurcationColumn>;

std::string table_of(const Columns& columns, const Arguments& arguments,
                     const physics::Model& model) {
  using physics::number_text;
  const physics::ResultUnits units(model);
  std::string table = units.column(arguments.over, unit_of(arguments.over, model)) + "," +
                      units.column("displacement_m", "m") + "," +
                      units.column("velocity_m_s", "m/s");
  table += arguments.exponents ? "," + units.column("exponent_per_s", "1/s") + "\n" : "\n";
  for (const auto& column : columns) {
    for (const dynamics::Point& point : column.section) {
      table += number_text(column.value, 9) + ',' + number_text(point.x(), 9) + ',' +
               number_text(point.v(), 9);
      if (arguments.exponents) table += ',' + number_text(column.exponent_per_s, 6);
      table += '\n';
    }
  }
  return table;
}

/// The axes in millimetres where they are lengths.
figures::BifurcationAxes axes_of(const std::string& path, const physics::Model& model) {
  const physics::ResultUnits units(model);
  const std::string unit = unit_of(path, model);
  const std::string name = physics::ResultUnits::bare(path, unit);
  constexpr double mm = 1.0e3;
  figures::BifurcationAxes axes;
  axes.parameter = units.axis(name, unit);
  axes.displacement = units.axis("displacement, once per drive period", "mm");
  axes.exponent = units.axis("largest exponent", "1/s");
  if (units.dimensionless()) return axes;
  axes.displacement_factor = mm;
  if (unit == "m") {
    axes.parameter = units.axis(name, "mm");
    axes.parameter_factor = mm;
  }
  return axes;
}

/// The file without its ending. Throws InputError if that is not .svg.
std::filesystem::path stem_of(const std::string& svg) {
  const std::filesystem::path path = svg;
  if (path.extension() == ".svg" && !path.stem().empty()) {
    return path.parent_path() / path.stem();
  }
  throw InputError(Problem{"--svg", 0, 0, "\"" + svg + "\": expected a name that ends in .svg"});
}

/// The drawing, its bitmap and its script.
std::vector<std::string> pictures_of(const std::string& svg) {
  const std::string stem = stem_of(svg).string();
  return {stem + ".svg", stem + ".png", stem + ".gp"};
}

void draw_diagram(const Columns& columns, const Arguments& arguments, const physics::Model& model,
                  const Outputs& outputs) {
  const std::string name = stem_of(arguments.svg).filename().string();
  terminal::Progress progress("drawing");
  const TemporaryFolder drawn;
  figures::draw(figures::bifurcation_picture(columns, arguments.exponents,
                                             axes_of(arguments.over, model), name),
                drawn.path());
  for (const std::string& picture : pictures_of(arguments.svg)) {
    outputs.write(picture, Form::plain,
                  content_of(drawn.path() / std::filesystem::path(picture).filename()));
  }
}

int run(const Arguments& arguments, const Outputs& outputs) {
  if (!arguments.svg.empty()) {
    for (const std::string& picture : pictures_of(arguments.svg)) outputs.check(picture);
  }
  const physics::Model model = config::load_model(arguments.drive->model);
  const dynamics::Drive drive = arguments.drive->drive(model, 0, swept_quantity(arguments.over));
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
  terminal::Progress progress(physics::counted(values.size(), "value") + " of " + arguments.over);
  options.progress = [&progress](std::size_t done, std::size_t all) { progress.at(done, all); };
  std::vector<dynamics::BifurcationColumn> columns;
  try {
    columns = dynamics::bifurcation(model, drive, arguments.over, values, options);
  } catch (const InputError& error) {
    throw arguments.drive->of_model(error);
  }
  progress.finish();
  if (!arguments.svg.empty()) draw_diagram(columns, arguments, model, outputs);
  if (arguments.out != "-" || arguments.svg.empty()) {
    outputs.write(arguments.out, Form::plain, table_of(columns, arguments, model));
  }
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
  add_output(*command, "--svg", arguments->svg,
             "Diagram to draw: FILE.svg, with FILE.png and its script FILE.gp beside it");
  command->footer("The first column of the table is the parameter, named with its unit.");
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(*command,
           {.examples = {{"Sweep the amplitude of the drive",
                          "stickslip bifurcation --model config/models/motivational.toml "
                          "--frequency-hz 4.2 --over drive.amplitude_m --from 0.006 --to 0.012 "
                          "--out diagram.csv --svg diagram.svg"}},
            .files = {model_files},
            .see_also = {"stickslip-poincare(1)", "stickslip-lyapunov(1)", "gnuplot(1)"}});
}

}  // namespace stickslip::commands
