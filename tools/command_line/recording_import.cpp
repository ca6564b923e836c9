// SPDX-License-Identifier: Apache-2.0
#include "tools/command_line/recording_import.h"

#include <algorithm>
#include <cstdio>

#include "config/import_map.h"
#include "physics/problem.h"
#include "protocol/foreign_csv.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/recording_input.h"
#include "tools/terminal/progress.h"

namespace stickslip::command_line {

namespace {

std::vector<protocol::ColumnRule> rules_of(const ImportOptions& options) {
  std::vector<protocol::ColumnRule> rules;
  if (!options.map.empty()) {
    for (const config::MappedColumn& each : config::load_import_map(options.map)) {
      rules.push_back({each.column, each.channel, each.unit, each.factor});
    }
  }
  for (const std::string& text : options.units) {
    const auto at = text.rfind('=');
    if (at == std::string::npos || at == 0 || at + 1 == text.size()) {
      throw InputError(Problem{
          "--unit", 0, 0, "is \"" + text + "\"; expected COLUMN=UNIT, as in displacement_m=mm"});
    }
    const std::string column = text.substr(0, at);
    const auto same = std::find_if(rules.begin(), rules.end(),
                                   [&](const auto& rule) { return rule.column == column; });
    protocol::ColumnRule& rule =
        same == rules.end() ? rules.emplace_back(protocol::ColumnRule{column}) : *same;
    rule.unit = text.substr(at + 1);
  }
  return rules;
}

}  // namespace

void add_import_options(CLI::App& command, ImportOptions& options) {
  add_input(command, "--map", options.map,
            "Mapping file (TOML) for a CSV file of another program: COLUMN = { channel, unit, "
            "factor, sign }")
      ->type_name("FILE");
  command
      .add_option("--unit", options.units,
                  "Unit of a column of a CSV file, in place of that in its header")
      ->type_name("COLUMN=UNIT")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

protocol::Recording recording_from(const std::filesystem::path& file, const ImportOptions& options,
                                   bool always, std::size_t most_frames) {
  const auto rules = rules_of(options);
  terminal::Progress progress("reading " + file.filename().string());
  protocol::ImportedRecording found = protocol::read_or_import(
      file, rules, always, [&progress](double share) { progress.at(share); }, most_frames);
  progress.finish();
  for (const std::string& guess : found.guesses) {
    std::fprintf(stderr, "stickslip: %s: %s\n", file.c_str(), guess.c_str());
  }
  warn_if_cut_off(found.recording);
  return std::move(found.recording);
}

}  // namespace stickslip::command_line
