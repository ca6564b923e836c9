// SPDX-License-Identifier: Apache-2.0
#include "config/fault_script.h"

#include <cmath>
#include <sstream>

#include "config/document.h"
#include "physics/number_text.h"
#include "physics/problem.h"

namespace stickslip::config {

namespace {

// Consistency of the keys of one fault.
void check(Document& document, std::size_t position, const Fault& fault) {
  const std::string path = "fault." + std::to_string(position) + ".";
  const bool at = document.has(path + "at_s");
  const bool between = document.has(path + "between_s");
  const auto report = [&](std::string_view key, const std::string& message) {
    document.report_fault(position, key, message);
  };
  if (!at && !between) {
    report("at_s",
           "is missing: expected a time [s] after the first frame, or between_s = [from, to] for a "
           "random time");
  } else if (at && between) {
    report("between_s", "is given together with at_s: remove one of the two");
  }
  if ((fault.kind == FaultKind::drift || fault.kind == FaultKind::clock_jump) &&
      fault.amount == 0.0) {
    report("amount", "is 0, which has no effect");
  }
  if (!fault.every_s) return;
  if (!fault.duration_s) {
    report("duration_s",
           "is missing with every_s: a fault that lasts to the end of the run cannot be repeated");
    return;
  }
  const double needed_s = fault.to_s - fault.from_s + *fault.duration_s;
  constexpr double resolution_s = 0.5e-9;
  if (needed_s > *fault.every_s + resolution_s) {
    report("every_s", "is " + physics::number_text(*fault.every_s, 6) +
                          " s, but a fault can end up to " + physics::number_text(needed_s, 6) +
                          " s after the earliest beginning: expected that much or more");
  }
}

std::string where(const Fault& fault) {
  return fault.channel ? " on " + std::string(info(*fault.channel).stem) : " on all channels";
}

std::string effect(const Fault& fault) {
  switch (fault.kind) {
    case FaultKind::noise:
      return "noise" + where(fault) + ", standard deviation " +
             physics::number_text(fault.amount, 6);
    case FaultKind::stick:
      return "stuck value" + where(fault);
    case FaultKind::drift:
      return "drift" + where(fault) + ", " + physics::number_text(fault.amount, 6) + " per second";
    case FaultKind::delay:
      return "delay of " + physics::number_text(fault.amount, 6) + " s" + where(fault) +
             (fault.reported ? ", reported" : ", not reported");
    case FaultKind::drop:
      return "frames are lost";
    case FaultKind::duplicate:
      return "frames are duplicated";
    case FaultKind::reorder:
      return "frames swap places with their successors";
    case FaultKind::saturate:
      return "saturation" + where(fault) + " at " + physics::number_text(fault.amount, 6);
    case FaultKind::nan:
      return "not a number" + where(fault);
    case FaultKind::clock_jump:
      return "the device's clock is " + physics::number_text(std::abs(fault.amount), 6) + " s " +
             (fault.amount > 0.0 ? "ahead" : "behind");
    case FaultKind::unplug:
      return "the device is unplugged";
    case FaultKind::stall:
      return fault.stall_blocking ? "a read blocks" : "no data arrives";
    case FaultKind::emergency_stop:
      return "the emergency stop is pressed";
    case FaultKind::amplifier_fault:
      return "the amplifier reports a fault";
    case FaultKind::output_differs:
      return "the drive reads back as another";
    case FaultKind::read_error:
      return "reads fail";
    case FaultKind::write_error:
      return "writes fail";
  }
  return "";
}

std::string when(const Fault& fault) {
  std::string text = fault.from_s == fault.to_s
                         ? "at " + physics::number_text(fault.from_s, 6) + " s"
                         : "at a random time from " + physics::number_text(fault.from_s, 6) +
                               " s to " + physics::number_text(fault.to_s, 6) + " s";
  text += fault.duration_s ? " for " + physics::number_text(*fault.duration_s, 6) + " s"
                           : " to the end";
  if (fault.every_s) text += ", every " + physics::number_text(*fault.every_s, 6) + " s";
  if (fault.probability < 1.0) {
    text += ", " + physics::number_text(fault.probability * 100.0, 6) + " % of the ";
    text += fault.kind == FaultKind::read_error    ? "reads"
            : fault.kind == FaultKind::write_error ? "writes"
                                                   : "frames";
  }
  return text;
}

}  // namespace

FaultScript parse_fault_script(std::string_view text, const std::string& name) {
  Document document(text, name, keys_of<FaultScript>());
  FaultScript script;
  script.file = name;
  script.text = text;
  if (document.sound()) {
    document.read(script);
    for (std::size_t i = 0; i < script.faults.size(); ++i) {
      Fault& fault = script.faults[i];
      // The amount of a stall is its duration.
      if (fault.kind == FaultKind::stall) fault.duration_s = fault.amount;
      check(document, i, fault);
    }
  }
  if (!document.sound()) throw InputError(document.take_problems());
  return script;
}

FaultScript load_fault_script(const std::filesystem::path& file) {
  return parse_fault_script(read_text(file), file.string());
}

std::string in_words(const Fault& fault) { return effect(fault) + ": " + when(fault); }

}  // namespace stickslip::config
