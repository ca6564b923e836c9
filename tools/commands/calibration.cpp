// SPDX-License-Identifier: Apache-2.0
// `stickslip calibration`: writes calibration files from measured points, and prints them.
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/calibration.h"
#include "config/document.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "tools/calibration/calibration_file.h"
#include "tools/calibration/line_fit.h"
#include "tools/calibration/points_csv.h"
#include "tools/calibration/words.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/files/utc_now.h"
#include "tools/terminal/page.h"

namespace stickslip::commands {

using namespace calibration;
using namespace command_line;

namespace {

struct FitArguments {
  std::string points;
  std::string channel;
  std::string file;
  std::string reference;
  std::string by;
  std::string date;
  std::string raw_unit;
  std::vector<double> valid_range;
  double accuracy_percent = 0.1;
  double scale_sigma_percent = 0.0;
  bool force = false;
  bool dry_run = false;
};

struct ShowArguments {
  std::string file;
  bool history = false;
};

std::string joined(const std::vector<calibration::Objection>& objections) {
  std::string out;
  for (const calibration::Objection& each : objections) {
    out += (out.empty() ? "" : "; ") + each.sentence;
  }
  return out;
}

config::ChannelCalibration proposal(const FitArguments& arguments, const calibration::LineFit& fit,
                                    const std::vector<calibration::Point>& points) {
  config::ChannelCalibration out = calibration::calibration_of(fit, points);
  out.reference = arguments.reference;
  out.by = arguments.by;
  out.date = arguments.date.empty() ? files::utc_now() : arguments.date;
  out.raw_unit = arguments.raw_unit;
  if (!arguments.valid_range.empty()) {
    const config::ValidRange range{arguments.valid_range[0], arguments.valid_range[1]};
    if (range.low >= range.high) {
      throw InputError(Problem{"", 0, 0, "--valid-range: expected LOW below HIGH"});
    }
    out.valid = range;
  }
  return out;
}

int run_fit(const FitArguments& arguments) {
  const Channel channel = *channel_named(arguments.channel);
  const auto points =
      calibration::parse_points(config::read_text(arguments.points), arguments.points);
  calibration::FitOptions options;
  options.accuracy = arguments.accuracy_percent / 100.0;
  options.scale_sigma = arguments.scale_sigma_percent / 100.0;
  options.two_references = arguments.force;
  options.unit = info(channel).unit;
  const calibration::LineFit fit = calibration::fit(points, options);
  if (!fit.solved || (!fit.acceptable() && !arguments.force)) {
    terminal::print_page(calibration::fit_text(fit, points, channel, arguments.raw_unit));
    std::fflush(stdout);
    throw InputError(
        Problem{arguments.points, 0, 0,
                "no calibration: " + joined(fit.objections) +
                    (fit.solved ? " (--force accepts it and records that in the file)" : "")});
  }
  const config::ChannelCalibration made = proposal(arguments, fit, points);

  const auto before = calibration_before(arguments.file, channel);
  terminal::print("%s: %s\n", arguments.channel.c_str(),
                  physics::counted(points.size(), "point").c_str());
  terminal::print_page(calibration::fit_text(fit, points, channel, arguments.raw_unit));
  terminal::print_page(calibration::change_text(before, made, channel));
  if (arguments.dry_run) return 0;
  renew_calibration(arguments.file, channel, made);
  terminal::print("%s: written%s\n", arguments.file.c_str(),
                  before ? "; the previous calibration is in its history" : "");
  return 0;
}

void print_calibration(const config::ChannelCalibration& entry, Channel channel) {
  terminal::print("%s\n  %s\n", std::string(info(channel).stem).c_str(),
                  calibration::calibration_words(entry, channel).c_str());
  const std::string unit(info(channel).unit);
  if (entry.valid) {
    for (const double si : {entry.valid->low, entry.valid->high}) {
      terminal::print("  at %s %s: +- %s %s by the calibration\n",
                      calibration::short_number(si).c_str(), unit.c_str(),
                      calibration::short_number(config::calibration_sigma(entry, si)).c_str(),
                      unit.c_str());
    }
  }
  for (Channel other : all_channels) {
    const double crosstalk = entry.crosstalk[index_of(other)];
    if (crosstalk == 0.0) continue;
    terminal::print("  less %s of %s\n", calibration::short_number(crosstalk).c_str(),
                    std::string(info(other).stem).c_str());
  }
  terminal::print("  %s, residuals %s %s\n", physics::counted(entry.points.size(), "point").c_str(),
                  calibration::short_number(entry.residual_std).c_str(), unit.c_str());
}

int run_show(const ShowArguments& arguments) {
  const config::CalibrationFile file = config::load_calibration(arguments.file);
  for (Channel channel : all_channels) {
    const auto& entry = file.channel[index_of(channel)];
    if (!entry) continue;
    print_calibration(*entry, channel);
    for (const config::FormerCalibration& each : file.history) {
      if (!arguments.history || each.channel != channel) continue;
      terminal::print("  before: %s\n",
                      calibration::calibration_words(each.calibration, channel).c_str());
    }
  }
  if (!arguments.history && !file.history.empty()) {
    terminal::print("%s: --history shows them\n",
                    physics::counted(file.history.size(), "previous calibration").c_str());
  }
  return 0;
}

void add_fit(CLI::App& parent, Action& action) {
  auto arguments = std::make_shared<FitArguments>();
  CLI::App* command = parent.add_subcommand(
      "fit", "Fit a straight line to points and write it to a calibration file");
  add_input(*command, "POINTS", arguments->points,
            "Points (CSV: raw, reference_si, optionally raw_std, reference_sigma), in the "
            "order of measurement")
      ->required();
  std::vector<std::string> stems;
  for (const ChannelInfo& channel : channel_table) stems.emplace_back(channel.stem);
  command->add_option("--channel", arguments->channel, "Calibrated channel")
      ->required()
      ->check(one_of(stems));
  add_calibration_file_option(*command, arguments->file);
  command
      ->add_option("--reference", arguments->reference,
                   "Reference standard: \"weights set 12, class M1\"")
      ->required()
      ->check([](const std::string& text) {
        return text.empty() ? std::string("expected a text") : std::string();
      });
  command->add_option("--by", arguments->by, "Name of the operator");
  command->add_option("--date", arguments->date, "Date, ISO 8601 (default: now)");
  command->add_option("--raw-unit", arguments->raw_unit,
                      "Unit of the raw readings, as the driver names it");
  command
      ->add_option("--valid-range", arguments->valid_range,
                   "LOW HIGH, SI: valid range (default: range of the references)")
      ->expected(2)
      ->check(finite_number());
  command
      ->add_option("--accuracy-percent", arguments->accuracy_percent,
                   "Deviations below this percentage of the span are negligible")
      ->check(not_negative_number())
      ->capture_default_str();
  command
      ->add_option("--scale-sigma-percent", arguments->scale_sigma_percent,
                   "Standard uncertainty common to all references, such as that of gravity")
      ->check(not_negative_number())
      ->capture_default_str();
  command->add_flag(
      "--force", arguments->force,
      "Accept the fit despite objections, with two references too; recorded in the file");
  command->add_flag("--dry-run", arguments->dry_run, "Print the result, write nothing");
  command->callback([&action, arguments, command] {
    action = [arguments, command] {
      outputs_of(*command);
      return run_fit(*arguments);
    };
  });
}

void add_show(CLI::App& parent, Action& action) {
  auto arguments = std::make_shared<ShowArguments>();
  CLI::App* command =
      parent.add_subcommand("show", "Print a calibration file with its uncertainties");
  add_input(*command, "FILE", arguments->file, "Calibration file (TOML)")->required();
  command->add_flag("--history", arguments->history, "Print previous calibrations too");
  command->callback(
      [&action, arguments] { action = [arguments] { return run_show(*arguments); }; });
}

}  // namespace

void add_calibration(CLI::App& app, Action& action) {
  CLI::App* command =
      app.add_subcommand("calibration", "Create calibration files from points, or print them");
  command->require_subcommand(1);
  add_fit(*command, action);
  add_show(*command, action);
  describe(
      *command,
      {.examples = {{"Fit a line to points and write it to a calibration file",
                     "stickslip calibration fit points.csv --channel friction_force "
                     "--reference \"weights set 12\" --file calibration.toml"},
                    {"Print a calibration file", "stickslip calibration show calibration.toml"}},
       .see_also = {"stickslip-ctl(1)"}});
}

}  // namespace stickslip::commands
