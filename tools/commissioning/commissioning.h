// SPDX-License-Identifier: Apache-2.0
// The acceptance of a bench, step by step, with a person. Knows neither terminal nor files.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "config/rig.h"
#include "drivers/driver.h"
#include "tools/commissioning/bench_session.h"
#include "tools/commissioning/record.h"

namespace stickslip::commissioning {

/// The person at the bench.
struct Person {
  std::function<void(const std::string& text)> show;
  /// A typed line; none at the end of the answers. `agreed`: the line of someone who agrees to all.
  /// Throws diagnosis::Interrupted on a request to stop.
  std::function<std::optional<std::string>(const std::string& question, const std::string& agreed)>
      ask;
};

/// The person ends the acceptance; what was measured is kept.
class Ended {};

struct Durations {
  double reading_s = 3.0;    ///< of zero and noise
  double response_s = 10.0;  ///< within which a push, a button or a plug has to show
  double return_s = 20.0;    ///< within which a device has to come back
  double motion_s = 10.0;    ///< of a motion by hand, for delays
  double drive_s = 3.0;      ///< of the drive at its full, small amplitude
  double timing_s = 5.0;     ///< of the measurement of cycles
};

/// Bench and person of a step.
struct Bench {
  BenchSession& session;
  const Person& person;
  Durations durations;

  /// Shows the question and waits; throws Ended for "q" and at the end of the answers.
  std::string ask(const std::string& question, const std::string& agreed = "") const;
  /// Asks the person to do something and press Enter; false: "s", it cannot be done.
  bool please(const std::string& what) const;
  void show(const std::string& text) const { person.show(text); }
};

struct Step {
  const char* id;     ///< "polarity"
  const char* title;  ///< "Polarity"
  const char* text;   ///< announcement, in sentences
  StepRecord (*run)(const Bench& bench);
};

/// All steps in their order; the drive is the last.
std::span<const Step> all_steps();

/// Records of a step; the caller adds step and date.
StepRecord passed(std::string text);
StepRecord failed(std::string text, std::string remedy);
StepRecord not_done(std::string text);
StepRecord not_applicable(std::string text);

/// Keys of a rig that an acceptance depends on, with their values as TOML; of the gains of the
/// calibrations only the sign.
std::vector<std::pair<std::string, std::string>> bench_settings(const config::Rig& rig);

struct Choice {
  std::vector<std::string> only;  ///< identifiers of the steps to make again; empty: all not passed
};

/// Makes the steps that the record does not have as passed. `keep` is called after each, and must
/// not throw. True if every step of the record is passed or not applicable. Throws
/// diagnosis::Interrupted on a request to stop, with the amplifier off and all steps kept.
bool commission(BenchSession& session, const Person& person, Record& record, const Choice& choice,
                const Durations& durations, const std::function<void(const Record&)>& keep);

/// The steps, in files of their own.
StepRecord identities(const Bench& bench);
StepRecord noise(const Bench& bench);
StepRecord shunt(const Bench& bench);
StepRecord polarity(const Bench& bench);
StepRecord delays(const Bench& bench);
StepRecord emergency_stop(const Bench& bench);
StepRecord amplifier_fault(const Bench& bench);
StepRecord plugs(const Bench& bench);
StepRecord timing(const Bench& bench);
StepRecord watchdog(const Bench& bench);
StepRecord drive(const Bench& bench);

}  // namespace stickslip::commissioning
