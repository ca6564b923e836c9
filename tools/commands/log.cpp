// SPDX-License-Identifier: Apache-2.0
// `stickslip log`: checks, repairs, joins, describes and exports recordings.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/json_text.h"
#include "protocol/recording_parts.h"
#include "protocol/recording_survey.h"
#include "tools/command_line/colour_option.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/files/outputs.h"
#include "tools/recording_export/table.h"
#include "tools/recording_export/write_tables.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;
using namespace recording_export;

namespace {

using physics::counted;
using physics::fixed_text;
using protocol::LogSurvey;
using Json = nlohmann::ordered_json;

constexpr std::size_t max_places_listed = 10;

struct Arguments {
  std::vector<std::string> files;
  std::string file;
  std::string out;
  bool json = false;
  terminal::Colours colours = terminal::Colours::automatic;
};

void print(const std::string& what, const std::string& text) {
  terminal::print("  %-22s %s\n", what.c_str(), text.c_str());
}

std::string frames_text(const LogSurvey& log) {
  if (log.frames == 0) return "none";
  std::string text = std::to_string(log.frames) + ", " + fixed_text(log.duration_s(), 3) +
                     " s, sequence " + std::to_string(log.first_sequence) + " to " +
                     std::to_string(log.last_sequence);
  text += log.gaps == 0
              ? ", no gap"
              : ", " + counted(log.missing, "frame") + " missing in " + counted(log.gaps, "gap");
  if (log.repeats > 0) text += ", " + counted(log.repeats, "number") + " that did not increase";
  return text;
}

std::string ledger_text(const LogSurvey& log) {
  const protocol::RecordedLedger& ledger = *log.ledger;
  std::string text = std::to_string(ledger.produced) +
                     " produced = " + std::to_string(ledger.recorded) + " recorded";
  for (std::size_t i = 0; i < ledger.losses.size(); ++i) {
    if (ledger.losses[i] == 0) continue;
    text += " + " + std::to_string(ledger.losses[i]) + " lost (" + ledger.loss_names[i] + ')';
  }
  if (!ledger.closed()) {
    text += " + " + std::to_string(ledger.produced - ledger.recorded - ledger.lost()) + " pending";
  }
  return text;
}

std::string part_text(const recording_info_t& info) {
  std::string text = std::to_string(info.part);
  if (info.part == 0 && info.frames_before == 0) return text + ", the first";
  return text + ", after " + info.previous_part + "; " + counted(info.frames_before, "frame") +
         " in the parts before";
}

// check

void print_check(const LogSurvey& log, const std::vector<std::string>& faults,
                 const terminal::Paint& paint) {
  const std::vector<std::string> gaps = log.gap_sentences();
  const std::string verdict = !faults.empty() ? paint(terminal::Tone::bad, "damaged")
                              : !gaps.empty() ? paint(terminal::Tone::warning, "with gaps")
                                              : paint(terminal::Tone::good, "intact");
  terminal::print("%s: %s\n", log.source.c_str(), verdict.c_str());
  for (const std::string& fault : faults) terminal::print("  %s\n", fault.c_str());
  for (const std::string& gap : gaps) terminal::print("  %s\n", gap.c_str());
  for (std::size_t i = 0; i < std::min(log.damaged.size(), max_places_listed); ++i) {
    const protocol::DamagedRange& place = log.damaged[i];
    print("at byte " + std::to_string(place.at), counted(place.bytes, "byte") + ": " + place.why);
  }
  const std::uint64_t places = log.damaged_places + log.bad_checksums + log.undecodable;
  if (places > max_places_listed) {
    terminal::print("  ... and %llu more\n",
                    static_cast<unsigned long long>(places - max_places_listed));
  }
  if (log.info && (log.info->part > 0 || !log.info->previous_part.empty())) {
    print("part", part_text(*log.info));
  }
  print("frames", frames_text(log));
  if (log.ledger) {
    print("ledger", ledger_text(log));
  } else {
    print("ledger", "none");
  }
  for (const protocol::ChannelEvents& channel : log.channels) {
    print(channel.name, counted(channel.events, "event") + ", " + counted(channel.bytes, "byte"));
  }
}

/// Inconsistencies between the files of each recording.
std::vector<std::string> faults_between(const std::vector<LogSurvey>& logs) {
  std::vector<std::vector<LogSurvey>> recordings;
  for (const LogSurvey& log : logs) {
    if (!log.info) continue;
    const auto same = [&log](const std::vector<LogSurvey>& recording) {
      return protocol::of_one_recording(*recording.front().info, *log.info);
    };
    auto known = std::find_if(recordings.begin(), recordings.end(), same);
    if (known == recordings.end()) known = recordings.insert(known, std::vector<LogSurvey>{});
    known->push_back(log);
  }
  std::vector<std::string> faults;
  for (std::vector<LogSurvey>& parts : recordings) {
    // Converted logs have no start that would distinguish them.
    if (parts.front().info->started_utc_us == 0) continue;
    std::sort(parts.begin(), parts.end(),
              [](const LogSurvey& a, const LogSurvey& b) { return a.part() < b.part(); });
    for (std::string& fault : protocol::faults_between(parts)) faults.push_back(std::move(fault));
  }
  return faults;
}

LogSurvey survey(const std::string& file) {
  terminal::Progress progress("reading " + file);
  return protocol::survey_log(file, [&progress](double share) { progress.at(share); });
}

int check(const Arguments& arguments, const Outputs&) {
  const terminal::Paint paint(terminal::wants_colour(arguments.colours, STDOUT_FILENO));
  bool intact = true;
  std::vector<LogSurvey> logs;
  for (const std::string& file : arguments.files) {
    logs.push_back(survey(file));
    const std::vector<std::string> faults = logs.back().faults();
    print_check(logs.back(), faults, paint);
    intact = intact && faults.empty();
  }
  for (const std::string& fault : faults_between(logs)) {
    terminal::print("%s\n", fault.c_str());
    intact = false;
  }
  return intact ? 0 : 1;
}

// repair

int repair(const Arguments& arguments, const Outputs& outputs) {
  terminal::Progress progress("repairing " + arguments.file);
  protocol::RepairResult done;
  outputs.write(arguments.out, [&](const std::filesystem::path& out) {
    done = protocol::repair_log(std::filesystem::path(arguments.file), out,
                                [&progress](double share) { progress.at(share); });
  });
  progress.finish();
  terminal::print("%s: %s with %s kept\n", arguments.out.c_str(),
                  counted(done.events, "event").c_str(), counted(done.frames, "frame").c_str());
  const auto dropped = [](std::uint64_t count, const std::string& noun, const std::string& what) {
    if (count > 0) print("dropped", counted(count, noun) + what);
  };
  dropped(done.damaged_places, "place", " outside of events");
  dropped(done.bad_checksums, "block", " of frames with a bad checksum");
  dropped(done.undecodable, "message", " that cannot be decoded");
  dropped(done.blocks_back_in_time, "block", " of frames with decreasing time stamps");
  dropped(static_cast<std::uint64_t>(done.damaged_bytes), "byte", "");
  dropped(static_cast<std::uint64_t>(done.cut_off_bytes), "byte", " of an incomplete last event");
  if (!done.dropped_anything()) print("dropped", "nothing: the log was intact");
  return 0;
}

// join

int join(const Arguments& arguments, const Outputs& outputs) {
  const std::vector<std::filesystem::path> files(arguments.files.begin(), arguments.files.end());
  terminal::Progress progress("joining");
  protocol::JoinResult joined;
  outputs.write(arguments.out, [&](const std::filesystem::path& out) {
    joined = protocol::join_logs(files, out, [&progress](double share) { progress.at(share); });
  });
  progress.finish();
  if (joined.cut_off_bytes > 0) {
    std::fprintf(stderr, "stickslip: the last part is truncated: without its last %s\n",
                 counted(joined.cut_off_bytes, "byte").c_str());
  }
  std::string text =
      arguments.out + ": " + counted(joined.parts, "part") + ", " + counted(joined.frames, "frame");
  if (joined.missing > 0) {
    text +=
        "; " + counted(joined.missing, "frame") + " missing between parts, lost by the recorder";
  }
  terminal::print_page(text + "\n");
  return 0;
}

// info

struct Digest {
  const char* name;
  const std::string& text;
  const std::string& sha256;
};

std::array<Digest, 4> digests_of(const recording_info_t& info) {
  return {{{"configuration", info.configuration, info.configuration_sha256},
           {"model", info.model, info.model_sha256},
           {"calibration", info.calibration, info.calibration_sha256},
           {"fault_script", info.fault_script, info.fault_script_sha256}}};
}

bool is_altered(const LogSurvey& log, const std::string& text) {
  return std::find(log.altered_texts.begin(), log.altered_texts.end(), text) !=
         log.altered_texts.end();
}

Json info_json(const LogSurvey& log) {
  Json out;
  out["file"] = log.source;
  out["bytes"] = log.bytes;
  if (log.info) {
    const recording_info_t& info = *log.info;
    out["rig"] = info.rig;
    out["program"] = info.program;
    out["version"] = info.version;
    out["schema"] = info.schema;
    out["started_utc_us"] = info.started_utc_us;
    out["part"] = {{"number", info.part},
                   {"previous", info.previous_part},
                   {"frames_before", info.frames_before}};
    for (const Digest& digest : digests_of(info)) {
      if (digest.text.empty()) continue;
      out["texts"][digest.name] = {{"bytes", digest.text.size()},
                                   {"sha256", digest.sha256},
                                   {"verified", !is_altered(log, digest.name)}};
    }
  }
  out["duration_s"] = log.duration_s();
  out["rate_hz"] = log.rate_hz();
  out["frames"] = {{"count", log.frames},
                   {"first_sequence", log.first_sequence},
                   {"last_sequence", log.last_sequence},
                   {"gaps", log.gaps},
                   {"missing", log.missing}};
  out["time_steps"] = Json::array();
  for (const protocol::TimeStep& step : log.time_steps) {
    out["time_steps"].push_back({{"after_sequence", step.after_sequence},
                                 {"after_s", static_cast<double>(step.after_ns) * 1e-9},
                                 {"excess_s", step.excess_s}});
  }
  for (const Channel channel : all_channels) {
    const protocol::ChannelRange& range = log.ranges[index_of(channel)];
    if (range.values == 0) continue;
    out["channels"][std::string(stickslip::info(channel).column)] = {
        {"values", range.values}, {"least", range.least}, {"greatest", range.greatest}};
  }
  for (const protocol::ChannelEvents& channel : log.channels) {
    out["events"][channel.name] = channel.events;
  }
  if (log.ledger) {
    Json lost = Json::object();
    for (std::size_t i = 0; i < log.ledger->losses.size(); ++i) {
      lost[log.ledger->loss_names[i]] = log.ledger->losses[i];
    }
    out["ledger"] = {{"produced", log.ledger->produced},
                     {"recorded", log.ledger->recorded},
                     {"lost", lost},
                     {"closed", log.ledger->closed()}};
  }
  out["model_changes"] = Json::array();
  for (const protocol::ModelChange& change : log.model_changes) {
    out["model_changes"].push_back({{"time_ns", change.time_ns}, {"message", change.message}});
  }
  out["cut_off_bytes"] = log.cut_off_bytes;
  out["faults"] = log.faults();
  return out;
}

void print_info(const LogSurvey& log) {
  terminal::print("%s\n", log.source.c_str());
  if (log.info) {
    const recording_info_t& info = *log.info;
    print("rig", info.rig.empty() ? "unknown" : info.rig);
    print("program", info.program.empty() ? "unknown" : info.program + ' ' + info.version);
    if (info.started_utc_us > 0) print("start", protocol::utc_text(info.started_utc_us));
    print("part", part_text(info));
    for (const Digest& digest : digests_of(info)) {
      std::string name = digest.name;
      std::replace(name.begin(), name.end(), '_', ' ');
      if (digest.text.empty()) {
        print(name, "none");
      } else {
        print(name, "SHA-256 " + digest.sha256 +
                        (is_altered(log, digest.name) ? ", does not match" : ", verified"));
      }
    }
  } else {
    print("description", "none");
  }
  for (const protocol::ModelChange& change : log.model_changes) {
    print("new model", "after " + fixed_text(static_cast<double>(change.time_ns) * 1e-9, 3) +
                           " s: " + change.message);
  }
  print("duration", fixed_text(log.duration_s(), 3) + " s");
  print("rate", physics::number_text(log.rate_hz(), 6) + " Hz");
  print("frames", frames_text(log));
  for (const Channel channel : all_channels) {
    const protocol::ChannelRange& range = log.ranges[index_of(channel)];
    if (range.values == 0) continue;
    const ChannelInfo& known = stickslip::info(channel);
    std::string text = physics::number_text(range.least, 6) + " to " +
                       physics::number_text(range.greatest, 6) + ' ' + std::string(known.unit);
    if (range.values < log.frames) text += ", in " + counted(range.values, "frame");
    print(std::string(known.stem), text);
  }
  if (log.ledger) print("ledger", ledger_text(log));
  for (const std::string& gap : log.gap_sentences()) print("gap", gap);
  for (const std::string& fault : log.faults()) print("fault", fault);
}

int info(const Arguments& arguments, const Outputs&) {
  const LogSurvey log = survey(arguments.file);
  if (arguments.json) {
    // A damaged text need not be UTF-8.
    std::printf("%s\n", protocol::json_text(info_json(log)).c_str());
  } else {
    print_info(log);
  }
  return 0;
}

// export

int export_recording(const Arguments& arguments, const Outputs& outputs) {
  terminal::Progress reading("reading " + arguments.file);
  Tables tables = tables_of(arguments.file, [&reading](double share) { reading.at(share); });
  reading.finish();
  if (!tables.cut_off_warning.empty()) {
    std::fprintf(stderr, "stickslip: %s\n", tables.cut_off_warning.c_str());
  }
  terminal::Progress writing("writing " + arguments.out);
  tables.written_by = outputs.author();
  outputs.write(arguments.out, [&](const std::filesystem::path& out) {
    write_tables(tables, out, [&writing](double share) { writing.at(share); });
  });
  writing.finish();
  std::string text;
  for (const Table& table : tables.tables) {
    text += (text.empty() ? " " : ", ") + counted(table.rows(), "row") + " of " + table.name;
  }
  terminal::print_page(arguments.out + ":" + text + "\n");
  return 0;
}

}  // namespace

void add_log(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* log = app.add_subcommand(
      "log", "Check, repair, join, describe and export recordings in LCM event logs");
  log->require_subcommand(1);
  const auto command = [&](const char* name, const char* what,
                           int (*run)(const Arguments&, const Outputs&)) {
    CLI::App* each = log->add_subcommand(name, what);
    each->callback([&action, arguments, run, each] {
      action = [arguments, run, each] { return run(*arguments, outputs_of(*each)); };
    });
    return each;
  };
  const auto one_file = [&arguments](CLI::App* each, const char* what) {
    add_input(*each, "FILE", arguments->file, what)->required();
  };
  const auto out = [&arguments](CLI::App* each) {
    add_output(*each, "--out", arguments->out, "The log to write")->required()->type_name("FILE");
  };

  CLI::App* each = command(
      "check", "Check every event of logs: status 1 if they are damaged, 0 if intact or with gaps",
      check);
  add_input(*each, "FILE", arguments->files, "LCM event logs; all parts of a recording")
      ->required()
      ->type_name("FILE");
  add_colour_option(*each, arguments->colours);
  each = command("repair", "Keep every intact event of a damaged log", repair);
  one_file(each, "LCM event log");
  out(each);
  each = command("join", "Join the parts of a recording", join);
  add_input(*each, "PART", arguments->files, "Its parts, in any order")
      ->required()
      ->type_name("FILE");
  out(each);
  each = command("info", "Describe a log", info);
  one_file(each, "LCM event log");
  add_json_flag(*each, arguments->json);
  each = command("export", "Export a recording for other programs", export_recording);
  add_recording(*each, arguments->file);
  add_output(*each, "OUT", arguments->out, "Output: .csv, .mat (MATLAB 5) or .h5 (HDF5)")
      ->required()
      ->type_name("FILE");
  describe(*log, {.examples = {{"Check the integrity of a recording and the balance of its ledger",
                                "stickslip log check run.log run.001.log"},
                               {"Export to another program", "stickslip log export run.log run.h5"},
                               {"Recover the intact events of a damaged log",
                                "stickslip log repair run.log --out whole.log"}},
                  .files = {recording_files},
                  .see_also = {"stickslip-convert(1)", "stickslip-record(1)"}});
}

}  // namespace stickslip::commands
