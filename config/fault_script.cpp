#include "config/fault_script.h"

#include <cmath>
#include <sstream>

#include "config/document.h"
#include "config/key.h"
#include "physics/problem.h"

namespace stickslip::config {

namespace {

/// As a person writes it.
std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

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
    report("every_s", "is " + number(*fault.every_s) +
                          " s, but what has to end before it comes "
                          "again takes up to " +
                          number(needed_s) + " s: expected that much or more");
  }
}

std::string where(const Fault& fault) {
  return fault.channel ? " on " + std::string(info(*fault.channel).stem) : " on all channels";
}

std::string what(const Fault& fault) {
  switch (fault.kind) {
    case FaultKind::noise:
      return "noise" + where(fault) + ", standard deviation " + number(fault.amount);
    case FaultKind::stick:
      return "a value that is kept" + where(fault);
    case FaultKind::drift:
      return "drift" + where(fault) + ", " + number(fault.amount) + " a second";
    case FaultKind::delay:
      return "delay of " + number(fault.amount) + " s" + where(fault) +
             (fault.told ? ", told" : ", not told");
    case FaultKind::drop:
      return "frames are lost";
    case FaultKind::duplicate:
      return "frames come twice";
    case FaultKind::reorder:
      return "frames change places with their successors";
    case FaultKind::saturate:
      return "saturation" + where(fault) + " at " + number(fault.amount);
    case FaultKind::nan:
      return "not a number" + where(fault);
    case FaultKind::clock_jump:
      return "the device's clock is " + number(std::abs(fault.amount)) + " s " +
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
  std::string text = fault.from_s == fault.to_s ? "at " + number(fault.from_s) + " s"
                                                : "some time between " + number(fault.from_s) +
                                                      " s and " + number(fault.to_s) + " s";
  text += fault.duration_s ? " for " + number(*fault.duration_s) + " s" : " to the end";
  if (fault.every_s) text += ", every " + number(*fault.every_s) + " s";
  if (fault.probability < 1.0) {
    text += ", " + number(fault.probability * 100.0) + " % of the ";
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
