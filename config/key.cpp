#include "config/key.h"

#include <array>
#include <cmath>
#include <sstream>

namespace stickslip::config {

namespace {

constexpr double none = std::numeric_limits<double>::infinity();

constexpr std::array model_table = {
    Key{"schema", Type::integer, "1", "Version of the format of this file", "required", 1, 1},
    Key{"oscillator.excitation", Type::choice, "",
        "What drives the rig: a moving base, a force on the mass, or an imposed motion", "required",
        0, 0, false, "base|force|imposed"},
    Key{"oscillator.mass_kg", Type::parameter, "kg", "Mass on the spring; not with imposed motion",
        "required", 0, none, true},
    Key{"oscillator.natural_frequency_hz", Type::parameter, "Hz",
        "Natural frequency without friction; instead of stiffness_n_m", "", 0, none, true},
    Key{"oscillator.stiffness_n_m", Type::parameter, "N/m",
        "Stiffness of the spring, 0: none; instead of natural_frequency_hz", "", 0, none},
    Key{"oscillator.damping_ratio", Type::parameter, "1",
        "Damping ratio of the first mode; instead of damping_n_s_m", "", 0, none},
    Key{"oscillator.damping_n_s_m", Type::parameter, "N s/m",
        "Viscous damping; instead of damping_ratio", "", 0, none},
    Key{"oscillator.two_well.linear_n_m", Type::parameter, "N/m",
        "Magnets: the restoring force is -linear_n_m x + cubic_n_m3 x^3 in place of k x", "", 0,
        none, true},
    Key{"oscillator.two_well.cubic_n_m3", Type::parameter, "N/m3",
        "Magnets: cubic part of the restoring force", "", 0, none, true},
    Key{"normal_load.law", Type::choice, "", "How the normal load comes about",
        "required in [normal_load]", 0, 0, false, "constant|wedge|measured"},
    Key{"normal_load.load_n", Type::parameter, "N",
        "Normal load, summed over both pads, at x = 0; laws constant and wedge", "", 0, none},
    Key{"normal_load.slope_per_m", Type::parameter, "1/m",
        "Relative change of the load per metre of deflection; law wedge", ""},
    Key{"friction.law", Type::choice, "",
        "Friction law: none, theta = g(v), or theta' = -rate (theta - g(v))", "none", 0, 0, false,
        "none|coulomb|state_variable"},
    Key{"friction.mu", Type::parameter, "1",
        "Coefficient of friction; in newtons where no normal load is declared",
        "required but for law none", 0, none},
    Key{"friction.transition_speed_m_s", Type::parameter, "m/s",
        "g(v) = tanh(v / transition_speed_m_s); 0: set-valued Coulomb friction",
        "required but for law none", 0, none},
    Key{"friction.rate_per_s", Type::parameter, "1/s", "Rate gamma of the law state_variable", "",
        0, none, true},
    Key{"load_cell.mass_kg", Type::parameter, "kg", "Mass of the load cell",
        "required in [load_cell]", 0, none, true},
    Key{"load_cell.natural_frequency_hz", Type::parameter, "Hz",
        "Natural frequency of the load cell", "required in [load_cell]", 0, none, true},
    Key{"load_cell.damping_ratio", Type::parameter, "1", "Damping ratio of the load cell",
        "required in [load_cell]", 0, none},
    Key{"load_cell.dynamics", Type::choice, "",
        "Eq. (1) of the paper taken as exact, or the load cell's whole equation",
        "required in [load_cell]", 0, 0, false, "quasi_static|resonant"},
    Key{"sensors.*.noise_std", Type::number, "the channel's",
        "Standard deviation of the channel's white noise", "unknown, estimated", 0, none, true},
    Key{"sensors.*.filters", Type::filters, "",
        "Analogue filters in the order of the signal: { kind = \"butterworth_lowpass\", order = 4, "
        "cutoff_hz = 25.0 } (order 1 to 8) or { kind = \"first_order_lowpass\", cutoff_hz = 150.0 "
        "}",
        "none"},
    Key{"physics", Type::terms, "",
        "[[physics]] tables: effects of the catalogue by id, with their parameters", "none"},
};

constexpr std::array rig_table = {
    Key{"schema", Type::integer, "1", "Version of the format of this file", "required", 1, 1},
    Key{"rig.name", Type::text, "", "Name of the rig, written into every recording", "required"},
    Key{"rig.model", Type::file, "",
        "Model file that the rig's owner believes in; the observer uses it", "required"},
    Key{"driver.kind", Type::choice, "", "Which device yields the channels", "required", 0, 0,
        false, "simulated|replay"},
    Key{"driver.simulated.truth", Type::file, "",
        "Model file that the simulated rig really follows", "rig.model"},
    Key{"driver.simulated.seed", Type::integer, "1", "Seed of the sensor noise", "1", 0, 9.0e15},
    Key{"driver.simulated.noise", Type::boolean, "", "Whether the sensors are noisy", "true"},
    Key{"driver.simulated.step_s", Type::number, "s", "Longest integration step", "1e-4", 0, 0.01,
        true},
    Key{"driver.simulated.shaker_bandwidth_hz", Type::number, "Hz",
        "Bandwidth of shaker and reconstruction filter (four poles)", "60", 0, 1.0e4, true},
    Key{"driver.simulated.real_time", Type::boolean, "",
        "false: time is simulated, as fast as it goes", "true"},
    Key{"driver.simulated.resolution.*", Type::number, "the channel's",
        "Quantisation step of a channel", "0: none", 0, none},
    Key{"driver.replay.recording", Type::file, "", "Recording to play (CSV or LCM log)",
        "required with kind replay"},
    Key{"driver.replay.speed", Type::number, "1",
        "1: as recorded, 10: ten times as fast, 0: as fast as it goes", "1", 0, 1.0e6},
    Key{"loop.rate_hz", Type::number, "Hz", "Cycles per second", "1000", 0, 2.0e4, true},
    Key{"loop.frames_per_block", Type::integer, "1", "Frames in an LCM message", "10", 1, 10000},
    Key{"loop.duration_s", Type::number, "s", "Stop after this time", "until told to stop", 0, none,
        true},
    Key{"loop.real_time_scheduling", Type::boolean, "",
        "Try real-time scheduling and locked memory; what is refused is reported", "true"},
    Key{"calibration.*.offset", Type::number, "raw", "SI = (raw - offset) * gain", "0"},
    Key{"calibration.*.gain", Type::number, "SI per raw", "SI = (raw - offset) * gain; not 0", "1"},
    Key{"excitation.enabled", Type::boolean, "", "Whether the shaker is driven at all", "false"},
    Key{"excitation.carrier_hz", Type::number, "Hz", "Frequency of the drive", "2.5", 0, 1.0e3,
        true},
    Key{"excitation.amplitude", Type::number, "m or N",
        "Largest amplitude of the base displacement, or of the force on force-excited rigs", "0", 0,
        none},
    Key{"excitation.modulation_hz", Type::number, "Hz",
        "Frequency at which the amplitude is modulated; 0: constant", "0", 0, 1.0e3},
    Key{"excitation.modulation_depth", Type::number, "1",
        "1: the amplitude falls to zero in every modulation period", "0", 0, 1},
    Key{"excitation.envelope", Type::envelope, "s, m or N",
        "Amplitude over time as [time_s, amplitude] points, linear in between; instead of "
        "amplitude and modulation",
        "none"},
    Key{"excitation.repeat", Type::boolean, "", "Whether the envelope begins anew at its end",
        "true"},
    Key{"excitation.ramp_s", Type::number, "s",
        "Time from zero to full amplitude at the start, and back at the stop", "0.5", 0, 60},
    Key{"lcm.enabled", Type::boolean, "", "Whether frames are published", "true"},
    Key{"lcm.url", Type::text, "", "LCM provider", "udpm://239.255.76.67:7667?ttl=0"},
    Key{"recording.enabled", Type::boolean, "", "Whether the daemon records", "false"},
    Key{"recording.file", Type::file, "", "LCM event log to write", "required with enabled"},
    Key{"observer.enabled", Type::boolean, "", "Whether the friction observer runs", "true"},
};

std::string range_text(const Key& key) {
  if (key.type == Type::choice) {
    std::string list(key.choices);
    for (std::size_t at = 0; (at = list.find('|', at)) != std::string::npos;)
      list.replace(at, 1, ", ");
    return list;
  }
  std::ostringstream text;
  const bool low = std::isfinite(key.low);
  const bool high = std::isfinite(key.high);
  if (key.type == Type::filters || key.type == Type::envelope || key.type == Type::terms ||
      (!low && !high)) {
    return "";
  }
  if (low) text << (key.above_low ? "above " : "from ") << key.low;
  if (high) text << (low ? " to " : "up to ") << key.high;
  return text.str();
}

void list(std::ostringstream& page, std::span<const Key> keys) {
  page << "| key | type | unit | range | without it | meaning |\n| --- | --- | --- | --- | --- | "
          "--- |\n";
  for (const Key& key : keys) {
    std::string path(key.path);
    const auto star = path.find('*');
    if (star != std::string::npos) path.replace(star, 1, "CHANNEL");
    page << "| `" << path << "` | " << name_of(key.type) << " | " << key.unit << " | "
         << range_text(key) << " | " << key.fallback << " | " << key.sentence << " |\n";
  }
}

}  // namespace

std::span<const Key> model_keys() { return model_table; }
std::span<const Key> rig_keys() { return rig_table; }

std::string_view name_of(Type type) {
  switch (type) {
    case Type::number:
      return "number";
    case Type::integer:
      return "whole number";
    case Type::boolean:
      return "true or false";
    case Type::text:
      return "text";
    case Type::choice:
      return "one of";
    case Type::file:
      return "path";
    case Type::parameter:
      return "number or { value, sigma }";
    case Type::filters:
      return "list of filters";
    case Type::envelope:
      return "list of points";
    case Type::terms:
      return "tables";
  }
  return "";
}

std::string keys_page() {
  std::ostringstream page;
  page << "# Configuration\n\n"
          "This page is written by `stickslip check --keys`; a test holds it against the program.\n"
          "Files are TOML. An unknown key is an error, so that a misspelt one is never ignored.\n"
          "CHANNEL is one of displacement, velocity, friction_force, normal_load, "
          "base_displacement, "
          "drive_force.\n\n"
          "## Rigs: what `stickslipd --config` reads\n\n";
  list(page, rig_keys());
  page << "\n## Models: what a rig's owner believes\n\n"
          "A plain number is known exactly; `{ value = 0.06, sigma = 0.0006 }` is known with that "
          "standard\n"
          "deviation and is calibrated on a recording before anything is called missing.\n\n";
  list(page, model_keys());
  return page.str();
}

}  // namespace stickslip::config
