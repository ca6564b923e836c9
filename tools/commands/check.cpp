// SPDX-License-Identifier: Apache-2.0
// `stickslip check`: reports every problem of rigs, models, fault scripts, calibrations and
// register maps.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/calibration.h"
#include "config/campaign.h"
#include "config/demand.h"
#include "config/document.h"
#include "config/fault_script.h"
#include "config/key.h"
#include "config/lcm_url.h"
#include "config/model_file.h"
#include "config/model_names.h"
#include "config/rig.h"
#include "drivers/bench/probe_bench.h"
#include "drivers/factory/make_bench.h"
#include "physics/catalogue.h"
#include "physics/friction_laws.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/recording.h"
#include "tools/command_line/colour_option.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/recording_input.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/commissioning/comparison.h"
#include "tools/commissioning/record.h"
#include "tools/files/read_file.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;

namespace {

struct Arguments {
  std::vector<std::string> files;
  bool keys = false;
  bool live = false;
  std::string commissioned;
  terminal::Colours colours = terminal::Colours::automatic;
};

void print(const char* what, const std::string& text) {
  terminal::print("  %-12s %s\n", what, text.c_str());
}

std::string oscillator_text(const physics::Model& model) {
  const std::string mass = physics::number_text(model.oscillator.mass_kg.value, 6) +
                           (model.dimensionless ? ", dimensionless" : " kg");
  switch (model.oscillator.excitation) {
    case physics::Excitation::base:
      return "driven by its base, " + mass;
    case physics::Excitation::force:
      return "driven by a force, " + mass;
    case physics::Excitation::imposed:
      return "imposed motion";
  }
  return "";
}

std::string model_summary(physics::Model model) {
  std::string text = oscillator_text(model);
  const physics::Term* law = physics::law_term(model);
  text +=
      ", friction " + (law != nullptr ? law->id : std::string(config::name_of(model.friction.law)));
  text += ", load " +
          std::string(model.normal_load ? config::name_of(model.normal_load->law) : "not declared");
  text += ", load cell " +
          std::string(model.load_cell ? config::name_of(model.load_cell->dynamics) : "none");
  for (const physics::Term& term : model.terms) text += term.law ? "" : ", " + term.id;
  for (const physics::Term& each : model.candidates) text += ", candidate " + each.id;
  const auto parameters = physics::parameters_of(model);
  std::size_t uncertain = 0;
  for (const physics::NamedParameter& each : parameters) {
    if (each.parameter->sigma > 0.0) ++uncertain;
  }
  return text + "; " + std::to_string(uncertain) + " of " +
         physics::counted(parameters.size(), "parameter") + (uncertain == 1 ? " is" : " are") +
         " uncertain";
}

/// "bench, labjack_u6; displacement from labjack_u6/AIN0, ..."
std::string bench_summary(const config::Bench& bench) {
  std::string text = "bench, " + std::string(config::name_of(bench.board));
  const char* between = "; ";
  for (const Channel channel : all_channels) {
    const auto& input = bench.inputs[index_of(channel)];
    if (!input) continue;
    text +=
        between + std::string(info(channel).stem) + " from " + input->device + "/" + input->input;
    between = ", ";
  }
  return text;
}

std::string driver_summary(const config::Rig& rig) {
  if (rig.driver == config::DriverKind::replay) {
    return "replay of " + rig.replay.recording.string() +
           (rig.replay.speed > 0.0
                ? " at " + physics::number_text(rig.replay.speed, 6) + " times its speed"
                : ", as fast as possible");
  }
  if (rig.driver == config::DriverKind::bench) return bench_summary(rig.bench);
  return "simulated, truth " + rig.simulated.truth_file.string() +
         (rig.simulated.real_time ? "" : ", as fast as possible");
}

std::string drive_summary(const config::Rig& rig) {
  const config::Excitation& drive = rig.excitation;
  if (rig.driver == config::DriverKind::replay) return "none: a replay has no drive";
  if (!drive.enabled) return "off";
  const bool base = rig.model.oscillator.excitation == physics::Excitation::base;
  const auto sized = [base](double amplitude) {
    return base ? physics::number_text(amplitude * 1000.0, 6) + " mm"
                : physics::number_text(amplitude, 6) + " N";
  };
  const std::string reach = "up to " + sized(config::demand_of(drive).displacement);
  const std::string span = physics::number_text(drive.sweep.from_hz, 6) + " to " +
                           physics::number_text(drive.sweep.to_hz, 6) + " Hz, " + reach;
  switch (drive.kind) {
    case config::ExcitationKind::modulated:
      break;
    case config::ExcitationKind::by_hand:
      return physics::number_text(drive.carrier_hz, 6) + " Hz, as if by hand from " +
             sized(drive.by_hand.lowest) + " " + reach;
    case config::ExcitationKind::sweep:
      return "sweep, " + span + ", in " + physics::number_text(drive.sweep.duration_s, 6) + " s";
    case config::ExcitationKind::chirp:
      return "bursts, " + span + ", of " + physics::number_text(drive.sweep.duration_s, 6) + " s";
    case config::ExcitationKind::multisine:
      return physics::counted(config::lines_of(drive).size(), "sine") + ", " + reach;
    case config::ExcitationKind::file:
      return drive.file.path.string();
  }
  std::string text = physics::number_text(drive.carrier_hz, 6) + " Hz, " + reach;
  if (!drive.envelope.empty()) {
    text += ", envelope of " + physics::number_text(drive.envelope.back().time_s, 6) + " s";
    if (drive.repeat) text += ", repeated";
  } else if (drive.modulation_hz > 0.0 && drive.modulation_depth > 0.0) {
    text += ", modulated at " + physics::number_text(drive.modulation_hz, 6) + " Hz";
  }
  return text;
}

/// "friction_force = (raw - 1.18e-05) 2114.6 N - 0.012 normal_load of 2026-03-02"
std::string calibration_line(const config::ChannelCalibration& calibration, Channel channel) {
  std::string text =
      std::string(info(channel).stem) + " = (raw - " + physics::number_text(calibration.offset, 6) +
      ") " + physics::number_text(calibration.gain, 6) + " " + std::string(info(channel).unit);
  for (Channel other : all_channels) {
    const double share = calibration.crosstalk[index_of(other)];
    if (share != 0.0)
      text += " - " + physics::number_text(share, 6) + " " + std::string(info(other).stem);
  }
  return text + (calibration.date.empty() ? "" : " of " + calibration.date);
}

std::string calibration_summary(const config::Rig& rig) {
  std::string text;
  for (Channel channel : all_channels) {
    const config::ChannelCalibration& each = rig.calibration[index_of(channel)];
    if (each == config::ChannelCalibration{}) continue;
    text += (text.empty() ? "" : ", ") + calibration_line(each, channel);
  }
  return text.empty() ? "none: every channel is in SI units" : text;
}

void summarise(const config::CalibrationFile& file) {
  for (Channel channel : all_channels) {
    const auto& each = file.channel[index_of(channel)];
    if (!each) continue;
    print("calibration", calibration_line(*each, channel) + ", against " + each->reference);
  }
  print("history", physics::counted(file.history.size(), "former calibration"));
}

std::string lcm_summary(const std::string& url) {
  const std::string reach = config::reach_of_lcm_url(url);
  return url + (reach.empty() ? "" : ": " + reach);
}

void summarise(const config::Rig& rig) {
  print("rig", rig.name);
  print("rate",
        physics::number_text(rig.loop.rate_hz, 6) + " Hz, " +
            physics::counted(rig.loop.frames_per_block, "frame") + " a message" +
            (rig.loop.duration_s ? ", for " + physics::number_text(*rig.loop.duration_s, 6) + " s"
                                 : ""));
  print("driver", driver_summary(rig));
  if (rig.faults) {
    print("faults", rig.faults->file.string() + ": " + std::to_string(rig.faults->faults.size()));
  }
  print("drive", drive_summary(rig));
  print("calibration", calibration_summary(rig));
  print("model", rig.model_file.string() + ": " + model_summary(rig.model));
  print("LCM", rig.lcm.enabled ? lcm_summary(rig.lcm.url) : "off");
  print("recording", rig.recording.enabled ? rig.recording.file.string() : "off");
  print("observer", rig.observer.enabled ? "on" : "off");
}

void summarise(const config::FaultScript& script) {
  print("seed", std::to_string(script.seed));
  if (script.faults.empty()) print("faults", "none: the device is unaltered");
  for (std::size_t i = 0; i < script.faults.size(); ++i) {
    print(("fault " + std::to_string(i + 1)).c_str(), config::in_words(script.faults[i]));
  }
}

void warn(const std::vector<Problem>& warnings) {
  std::fflush(stdout);
  for (Problem warning : warnings) {
    warning.message.insert(0, "warning: ");
    std::fprintf(stderr, "%s\n", warning.text().c_str());
  }
}

/// The acceptance of a bench: that of --commissioned, or the one beside its file, if any.
std::optional<commissioning::Record> acceptance_of(const std::string& rig,
                                                   const std::string& commissioned) {
  if (commissioned.empty()) {
    return commissioning::load_record(commissioning::folder_beside(rig) /
                                      commissioning::record_name);
  }
  return commissioning::parse_record(files::content_of(commissioned), commissioned);
}

void summarise_acceptance(const config::Rig& rig, const std::string& commissioned) {
  const auto record = acceptance_of(rig.file.string(), commissioned);
  if (!record) return print("acceptance", "none: stickslip commission " + rig.file.string());
  print("acceptance", "of " + record->begun);
  std::vector<Problem> warnings;
  for (const std::string& each : commissioning::reservations(*record, rig)) {
    warnings.push_back({rig.file.string(), 0, 0, each});
  }
  warn(warnings);
}

/// Prints a summary of a file, or every problem in it. True if it is valid.
bool check(const std::string& file, const std::string& commissioned, const terminal::Paint& paint) {
  const std::string valid = paint(terminal::Tone::good, "valid");
  try {
    const std::string text = config::read_text(file);
    const auto kind = config::kind_of(text);
    if (!kind) {
      throw InputError(
          Problem{file, 1, 1,
                  "is not a configuration file: expected a rig with a table [rig], a model with "
                  "[oscillator], candidates with [[candidate]], a fault script with [[fault]], a "
                  "calibration with [channel.CHANNEL], a "
                  "register map with [[register]], or a campaign with [[recording]]"});
    }
    switch (*kind) {
      case config::FileKind::rig: {
        const config::Rig rig = config::load_rig(file);
        if (rig.driver == config::DriverKind::replay) {
          recording_from(rig.replay.recording);
        }
        terminal::print("%s: %s\n", file.c_str(), valid.c_str());
        summarise(rig);
        if (rig.driver == config::DriverKind::bench) summarise_acceptance(rig, commissioned);
        warn(rig.warnings);
        break;
      }
      case config::FileKind::model: {
        const physics::Model model = config::parse_model(text, file);
        terminal::print("%s: %s\n", file.c_str(), valid.c_str());
        print("model", model_summary(model));
        break;
      }
      case config::FileKind::candidates: {
        physics::Model none;
        config::add_candidates(file, none);
        terminal::print("%s: %s\n", file.c_str(), valid.c_str());
        for (const physics::Term& each : none.candidates) {
          print("candidate", std::string(physics::effect_of(each)->card().equation));
        }
        break;
      }
      case config::FileKind::campaign: {
        const config::CampaignFile campaign = config::parse_campaign(text, file);
        terminal::print("%s: %s\n", file.c_str(), valid.c_str());
        for (const config::CampaignRecording& each : campaign.recordings) {
          print("recording", each.name + (each.held_out ? " (held out)" : ""));
        }
        break;
      }
      case config::FileKind::fault_script: {
        const config::FaultScript script = config::parse_fault_script(text, file);
        terminal::print("%s: %s\n", file.c_str(), valid.c_str());
        summarise(script);
        break;
      }
      case config::FileKind::modbus_map: {
        const config::ModbusMap map = config::parse_modbus_map(text, file);
        terminal::print("%s: %s\n", file.c_str(), valid.c_str());
        print("unit", map.name);
        print("registers", std::to_string(map.registers.size()));
        break;
      }
      case config::FileKind::calibration: {
        const config::CalibrationFile calibration = config::parse_calibration(text, file);
        terminal::print("%s: %s\n", file.c_str(), valid.c_str());
        summarise(calibration);
        break;
      }
    }
    return true;
  } catch (const InputError& error) {
    std::fflush(stdout);
    for (const Problem& problem : error.problems()) {
      std::fprintf(stderr, "%s\n", problem.text().c_str());
    }
    return false;
  }
}

/// Warns of changes since the acceptance, by the readings of a device.
void compare(const commissioning::Record& record, const config::Rig& rig,
             const drivers::ProbedDevice& device) {
  std::vector<Problem> warnings;
  const auto add = [&](const std::string& text) {
    warnings.push_back({rig.file.string(), 0, 0, text});
  };
  const bool known = record.devices.empty() || device.name == "amplifier" ||
                     record.devices.find(device.name) != std::string::npos;
  if (!known) add(device.name + " is none of the devices that were accepted: " + record.devices);
  for (const drivers::ProbedInput& each : device.readings) {
    for (const std::string& text : commissioning::drifts(
             record, {each.channel, each.mean, each.standard_deviation, each.readings})) {
      add(text);
    }
  }
  warn(warnings);
}

void print_reading(const config::Rig& rig, const drivers::ProbedInput& reading) {
  const config::ChannelCalibration& line = rig.calibration[index_of(reading.channel)];
  const ChannelInfo& channel = info(reading.channel);
  const std::string what = std::string(channel.stem) + " from " + reading.input;
  if (reading.readings == 0) {
    terminal::print("  %-32s no reading\n", what.c_str());
    return;
  }
  terminal::print("  %-32s %.6g %s, scatter %.2g, %s: %.6g %s\n", what.c_str(), reading.mean,
                  reading.unit.c_str(), reading.standard_deviation,
                  physics::counted(reading.readings, "reading").c_str(),
                  (reading.mean - line.offset) * line.gain, channel.unit.data());
}

/// Reads each device of a valid rig for the first time. True if all respond.
bool try_live(const std::string& file, const std::string& commissioned,
              const terminal::Paint& paint) {
  const config::Rig rig = config::load_rig(file);
  if (rig.driver != config::DriverKind::bench) {
    throw InputError(Problem{file, 0, 0, "has no devices: --live needs driver.kind = \"bench\""});
  }
  constexpr double timeout_s = 2.0;
  terminal::Progress progress("reading the devices of " + file);
  const auto tried = drivers::probe_bench(drivers::make_bench_parts(rig.bench, rig.loop.rate_hz),
                                          rig.bench, timeout_s);
  progress.finish();
  const auto record = acceptance_of(file, commissioned);
  bool well = true;
  for (const drivers::ProbedDevice& device : tried) {
    well = well && device.ok;
    terminal::print(
        "%s: %s%s%s\n", device.name.c_str(),
        (device.ok ? paint(terminal::Tone::good, "responds") : paint(terminal::Tone::bad, "FAILS"))
            .c_str(),
        device.message.empty() ? "" : ": ", device.message.c_str());
    for (const drivers::ProbedInput& reading : device.readings) print_reading(rig, reading);
    if (record && device.ok) compare(*record, rig, device);
  }
  return well;
}

int run(const Arguments& arguments) {
  if (arguments.keys) {
    std::fputs(config::keys_page().c_str(), stdout);
    return 0;
  }
  if (arguments.files.empty()) throw InputError(Problem{"", 0, 0, "check: expected FILE..."});
  const terminal::Paint paint(terminal::wants_colour(arguments.colours, STDOUT_FILENO));
  bool valid = true;
  for (const std::string& file : arguments.files) {
    valid = check(file, arguments.commissioned, paint) && valid;
  }
  if (!valid) return 2;
  if (!arguments.live) return 0;
  bool well = true;
  for (const std::string& file : arguments.files) {
    well = try_live(file, arguments.commissioned, paint) && well;
  }
  return well ? 0 : 1;
}

}  // namespace

void add_check(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "check",
      "Report all problems in rigs, models, calibrations, fault scripts and register maps");
  add_input(*command, "FILE", arguments->files,
            "Rigs, models, calibrations, fault scripts or register maps (TOML)")
      ->transform(shipped_file(""));
  command->add_flag(
      "--live", arguments->live,
      "Then read each device of the rig and print its first readings, without driving "
      "it; no daemon may use it");
  add_input(*command, "--commissioned", arguments->commissioned,
            "Compare the bench with this acceptance (default: BENCH.commissioned/"
            "commissioned.json beside it, if there)");
  command->add_flag("--keys", arguments->keys, "Print all keys as docs/configuration.md")
      ->group("");
  add_colour_option(*command, arguments->colours);
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
  describe(*command, {.examples = {{"Check rigs and models offline",
                                    "stickslip check config/simulated.toml model.toml"},
                                   {"Print the first readings of each device",
                                    "stickslip check --live config/bench-u6.toml"}},
                      .files = {model_files},
                      .see_also = {"stickslip-config(1)", "stickslip-doctor(1)"}});
}

}  // namespace stickslip::commands
