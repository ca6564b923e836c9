// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "physics/number_text.h"
#include "protocol/recording.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/recording_input.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/figures/gnuplot.h"
#include "tools/figures/reduction_pictures.h"
#include "tools/files/outputs.h"
#include "tools/files/write_file.h"
#include "tools/reduction/reduction.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

using physics::fixed_text;

struct Arguments {
  std::string recording;
  std::string model;
  std::string method = "deconvolved";
  std::optional<std::size_t> first;
  std::optional<std::size_t> samples;
  std::optional<double> drive_hz;
  std::size_t bins = 24;
  std::optional<std::string> out;
  bool no_pictures = false;
};

void print_summary(const reduction::Reduction& reduced, const Arguments& arguments,
                   const protocol::Recording& recording) {
  const auto& samples = reduced.samples;
  terminal::print("%s: %zu of %s, %.3f s to %.3f s, driven at %.3f Hz, method %s\n",
                  arguments.recording.c_str(), samples.size(),
                  physics::counted(recording.frames.size(), "sample").c_str(),
                  samples.front().time_s, samples.back().time_s, reduced.drive_hz,
                  arguments.method.c_str());
  terminal::print("inertia of the load cell: up to %.1f %% of the largest friction force\n",
                  100.0 * reduced.inertia_share);
  terminal::print("normal load: %s to %s N; N = %s N (1 %c %.4g/m x) has %.1f %% of its variance\n",
                  fixed_text(reduced.normal_load_n.low, 4).c_str(),
                  fixed_text(reduced.normal_load_n.high, 4).c_str(),
                  fixed_text(reduced.load_n, 4).c_str(), reduced.slope_per_m < 0.0 ? '-' : '+',
                  std::abs(reduced.slope_per_m), 100.0 * reduced.linear_share);
  terminal::print(
      "sliding mu: %s to %s (10 %% to 90 %% of mu sign(v) while abs(v) is above half of its "
      "largest)\n",
      fixed_text(reduced.sliding_mu.low, 3).c_str(),
      fixed_text(reduced.sliding_mu.high, 3).c_str());
  terminal::print("friction and velocity of opposite sign: %.2f %% of the samples\n",
                  100.0 * reduced.negative_friction);
}

int run(const Arguments& arguments, const Outputs& outputs) {
  const physics::Model model = config::load_model(arguments.model);
  const protocol::Recording recording = recording_from(arguments.recording);
  reduction::Options options;
  options.method =
      arguments.method == "paper" ? reduction::Method::paper : reduction::Method::deconvolved;
  options.first = arguments.first;
  options.samples = arguments.samples;
  options.drive_hz = arguments.drive_hz;
  options.bins = arguments.bins;
  terminal::Progress reducing("reducing");
  const reduction::Reduction reduced = reduction::reduce(recording, model, options);
  reducing.finish();
  print_summary(reduced, arguments, recording);
  if (!arguments.out) return 0;

  const std::filesystem::path folder = *arguments.out;
  OutputFolder out(folder, outputs);
  write_file(out.path() / "samples.csv", figures::samples_csv(reduced));
  write_file(out.path() / "surface.csv", figures::surface_csv(reduced));
  std::string written = "samples.csv, surface.csv";
  if (!arguments.no_pictures) {
    terminal::Progress progress("drawing");
    const std::vector<figures::Picture> pictures = figures::reduction_pictures(reduced);
    for (const figures::Picture& picture : pictures) {
      progress.set_label("drawing " + picture.stem);
      figures::draw(picture, out.path());
      progress.at(static_cast<std::size_t>(&picture - pictures.data()) + 1, pictures.size());
      written += ", " + picture.stem + ".svg";
    }
  }
  out.keep();
  terminal::print("%s: %s\n", folder.c_str(), written.c_str());
  return 0;
}

}  // namespace

void add_reduce(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "reduce", "Reduce a recording to the friction coefficient over displacement and velocity");
  add_recording(*command, arguments->recording);
  add_model_option(*command, arguments->model);
  command
      ->add_option("--method", arguments->method,
                   "paper: 800 raw samples, drift removed, Eq. (1); deconvolved: all samples, "
                   "filters inverted, equation of motion of the load cell")
      ->check(one_of({"paper", "deconvolved"}))
      ->capture_default_str();
  command->add_option("--samples", arguments->samples, "Number of samples")
      ->check(whole_number(1, 1e12));
  command->add_option("--first", arguments->first,
                      "First sample, from 0 (default: start of the longest part without gaps)");
  command
      ->add_option("--drive-hz", arguments->drive_hz,
                   "Frequency of the drive in Eq. (1) (default: strongest tone of the base)")
      ->check(positive_number());
  command->add_option("--bins", arguments->bins, "Cells of the surface along each axis")
      ->check(whole_number(1, 1000))
      ->capture_default_str();
  add_output_folder(*command, "--out", arguments->out,
                    "Folder for samples.csv, surface.csv and the figures (SVG and PNG)");
  command->add_flag("--no-pictures", arguments->no_pictures, "Write the tables only");
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(*command,
           {.examples = {{"Compute the coefficient of friction with its surface and pictures",
                          "stickslip reduce run.log --model model.toml --out reduced"},
                         {"Follow the method of the paper",
                          "stickslip reduce run.log --model model.toml --method paper"}},
            .files = {recording_files, model_files},
            .see_also = {"stickslip-figures(1)"}});
}

}  // namespace stickslip::commands
