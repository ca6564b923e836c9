// SPDX-License-Identifier: Apache-2.0
// Options and input of the commands that fit models to recordings.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/diagnosis.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/report/provenance.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/recording_import.h"
#include "tools/command_line/shared_options.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

struct DiagnosisArguments {
  std::vector<std::string> recordings;
  std::string model;
  command_line::ImportOptions columns;
  std::string json;
  std::string html;
  std::string write_model;
  std::uint64_t seed = 1;
  int jobs = 0;
  double horizon_s = 0.0;
};

/// Those behind RECORDING and --model.
inline void add_diagnosis_options(CLI::App& command, DiagnosisArguments& arguments,
                                  const std::string& written_model) {
  using namespace command_line;
  add_import_options(command, arguments.columns);
  add_json_file_option(command, arguments.json);
  add_output(command, "--html", arguments.html,
             "Write the report as one self-contained page with figures");
  add_output(command, "--write-model", arguments.write_model, written_model);
  add_seed_option(command, arguments.seed);
  add_jobs_option(command, arguments.jobs);
  add_horizon_option(command, arguments.horizon_s);
}

/// Long recordings are thinned out together.
template <typename Path>
std::vector<protocol::Recording> recordings_from(const std::vector<Path>& paths,
                                                 const command_line::ImportOptions& columns) {
  std::vector<protocol::Recording> out;
  for (const Path& path : paths) {
    out.push_back(
        command_line::recording_from(path, columns, false, diagnosis::most_frames / paths.size()));
  }
  return out;
}

/// None: the default.
inline std::optional<double> horizon_of(const DiagnosisArguments& arguments) {
  if (arguments.horizon_s > 0.0) return arguments.horizon_s;
  return std::nullopt;
}

/// `progress` shows the steps for as long as the options are used.
inline diagnosis::Options options_of(const DiagnosisArguments& arguments,
                                     terminal::Progress& progress) {
  diagnosis::Options out;
  out.seed = arguments.seed;
  out.threads = parallel::threads_for(arguments.jobs);
  out.horizon_s = horizon_of(arguments);
  out.evidence = !arguments.html.empty();
  out.progress = [&progress](const std::string& what, double done) {
    progress.set_label(what);
    progress.at(done);
  };
  return out;
}

}  // namespace stickslip::commands
