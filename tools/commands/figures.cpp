// SPDX-License-Identifier: Apache-2.0
// `stickslip figures`: the figures of the paper.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "config/shipped_files.h"
#include "diagnosis/parallel/for_each.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/figures/paper_figures.h"
#include "tools/files/outputs.h"
#include "tools/files/write_file.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

struct Arguments {
  std::string out;
  std::string presets;
  std::vector<int> only;
  int periods = 2000;
  int jobs = 0;
};

std::filesystem::path presets_of(const Arguments& arguments) {
  if (!arguments.presets.empty()) return arguments.presets;
  const std::filesystem::path shipped = config::shipped_folder();
  if (shipped.empty()) {
    throw InputError(Problem{"", 0, 0,
                             "the presets are not installed with the program (../share/stickslip "
                             "from its folder): expected --presets DIR"});
  }
  return shipped;
}

/// The rigs and models of a folder of presets.
std::vector<std::string> files_of(const std::filesystem::path& presets) {
  std::vector<std::string> out;
  std::error_code error;  // of a folder that does not exist, which the figures report
  for (const auto& folder : {presets, presets / "models"}) {
    for (const auto& each : std::filesystem::directory_iterator(folder, error)) {
      if (each.path().extension() == ".toml") out.push_back(each.path().string());
    }
  }
  return out;
}

int run(const Arguments& arguments, Outputs outputs) {
  figures::FigureOptions options;
  options.presets = presets_of(arguments);
  outputs.add_inputs(files_of(options.presets));
  OutputFolder out(arguments.out, outputs);
  options.out = out.path();
  options.numbers = arguments.only;
  options.periods = arguments.periods;
  options.threads = parallel::threads_for(arguments.jobs);
  terminal::Progress progress("drawing the figures");
  options.progress = [&progress](int, std::size_t ready, std::size_t all) {
    progress.at(ready, all);
  };
  const std::vector<figures::Figure> drawn = figures::draw_paper_figures(options);
  progress.finish();
  write_file(options.out / "index.html",
             figures::page(drawn, "stickslip figures --out " + arguments.out));
  out.keep();
  const std::filesystem::path page = std::filesystem::path(arguments.out) / "index.html";
  terminal::print("%s: %s\n", page.c_str(), physics::counted(drawn.size(), "figure").c_str());
  return 0;
}

}  // namespace

void add_figures(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "figures", "Draw figures 2 to 10 of the paper from the presets, on one HTML page");
  add_output_folder(*command, "--out", arguments->out,
                    "Folder for the page, the figures and their data")
      ->required();
  add_input(*command, "--presets", arguments->presets,
            "Folder with the rigs beam-1.toml to beam-4.toml and motivational.toml (default: "
            "those installed with the program)")
      ->type_name("DIR");
  command->add_option("--only", arguments->only, "Numbers of the figures to draw")->delimiter(',');
  command
      ->add_option("--periods", arguments->periods,
                   "Drive periods over which exponents and shares of time are computed")
      ->check(whole_number(40, 1000000))
      ->capture_default_str();
  add_jobs_option(*command, arguments->jobs);
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(*command,
           {.examples = {{"Draw all figures of the paper", "stickslip figures --out figures"}},
            .see_also = {"stickslip-reduce(1)", "gnuplot(1)"}});
}

}  // namespace stickslip::commands
