#include "config/fault_script.h"

#include <cmath>
#include <sstream>

#include "config/document.h"
#include "config/key.h"
#include "physics/number_text.h"
#include "physics/problem.h"

namespace stickslip::config {

namespace {

// What the keys of one fault mean together.
void check(Document& document, std::size_t position, const Fault& fault, bool at, bool between) {
  const auto report = [&](std::string_view key, const std::string& message) {
    document.report_fault(position, key, message);
  };
  if (!at && !between) {
    report("at_s",
           "is missing: expected a time [s] from the first frame on, or between_s = [from, "
           "to] for a moment drawn by chance");
  } else if (at && between) {
    report("between_s", "stands beside at_s: keep one of the two");
  }
  if ((fault.kind == FaultKind::drift || fault.kind == FaultKind::clock_jump) &&
      fault.amount == 0.0) {
    report("amount", "is 0, so that nothing would happen");
  }
  if (!fault.every_s) return;
  if (!fault.duration_s) {
    report("duration_s",
           "is missing with every_s: what lasts to the end of the run does not come "
           "again");
    return;
  }
  const double needed_s = fault.to_s - fault.from_s + *fault.duration_s;
  // As close as nanoseconds tell.
  if (needed_s > *fault.every_s + 0.5e-9) {
    report("every_s", "is " + physics::number_text(*fault.every_s, 6) +
                          " s, but what has to end before it comes "
                          "again takes up to " +
                          physics::number_text(needed_s, 6) + " s: expected that much or more");
  }
}

std::string where(const Fault& fault) {
  return fault.channel ? " on " + std::string(info(*fault.channel).stem) : " on all channels";
}

std::string what(const Fault& fault) {
  switch (fault.kind) {
    case FaultKind::noise:
      return "noise" + where(fault) + ", standard deviation " +
             physics::number_text(fault.amount, 6);
    case FaultKind::stick:
      return "a value that is kept" + where(fault);
    case FaultKind::drift:
      return "drift" + where(fault) + ", " + physics::number_text(fault.amount, 6) + " a second";
    case FaultKind::delay:
      return "delay of " + physics::number_text(fault.amount, 6) + " s" + where(fault) +
             (fault.reported ? ", reported" : ", not reported");
    case FaultKind::drop:
      return "frames are lost";
    case FaultKind::duplicate:
      return "frames come twice";
    case FaultKind::reorder:
      return "frames change places with their successors";
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
      return fault.stall_blocking ? "a read does not return" : "no data comes";
    case FaultKind::emergency_stop:
      return "the emergency stop is pressed";
    case FaultKind::amplifier_fault:
      return "the amplifier reports a fault";
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
                         : "some time between " + physics::number_text(fault.from_s, 6) +
                               " s and " + physics::number_text(fault.to_s, 6) + " s";
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
  Document document(text, name, fault_script_keys());
  FaultScript script;
  script.file = name;
  script.text = text;
  if (document.sound()) {
    if (const auto seed = document.integer("seed")) script.seed = static_cast<std::uint64_t>(*seed);
    script.faults = document.faults();
    for (std::size_t i = 0; i < script.faults.size(); ++i) {
      check(document, i, script.faults[i], document.fault_has(i, "at_s"),
            document.fault_has(i, "between_s"));
    }
  }
  if (!document.sound()) throw InputError(document.take_problems());
  return script;
}

FaultScript load_fault_script(const std::filesystem::path& file) {
  return parse_fault_script(read_text(file), file.string());
}

std::string in_words(const Fault& fault) { return what(fault) + ": " + when(fault); }

}  // namespace stickslip::config
