#include "config/key.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "physics/frame.h"

namespace stickslip::config {

namespace {

constexpr double unlimited = std::numeric_limits<double>::infinity();

constexpr std::string_view moving = "oscillator.excitation=base|force";
constexpr std::string_view rubbing = "friction.law=coulomb|state_variable";

constexpr std::array model_table = {
    Key{.path = "schema",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Version of the format of this file.",
        .need = Need::always,
        .low = 1,
        .high = 1},
    Key{.path = "oscillator.excitation",
        .type = Type::choice,
        .sentence = "What drives the rig: its base moves, a force acts on the mass, or the motion "
                    "is imposed and the recorded one; then nothing else stands in [oscillator].",
        .need = Need::always,
        .choices = "base|force|imposed"},
    Key{.path = "oscillator.mass_kg",
        .type = Type::parameter,
        .unit = "kg",
        .sentence = "Mass on the spring.",
        .need = Need::always,
        .when = moving,
        .only_then = true,
        .low = 0,
        .above_low = true},
    Key{.path = "oscillator.natural_frequency_hz",
        .type = Type::parameter,
        .unit = "Hz",
        .sentence = "Natural frequency without friction; or stiffness_n_m.",
        .when = moving,
        .only_then = true,
        .low = 0,
        .above_low = true},
    Key{.path = "oscillator.stiffness_n_m",
        .type = Type::parameter,
        .unit = "N/m",
        .sentence = "Stiffness of the spring, 0 where there is none; or natural_frequency_hz.",
        .when = moving,
        .only_then = true,
        .low = 0},
    Key{.path = "oscillator.damping_ratio",
        .type = Type::parameter,
        .unit = "1",
        .sentence = "Damping ratio of the mass on its spring; or damping_n_s_m.",
        .when = moving,
        .only_then = true,
        .low = 0},
    Key{.path = "oscillator.damping_n_s_m",
        .type = Type::parameter,
        .unit = "N s/m",
        .sentence = "Viscous damping; or damping_ratio.",
        .when = moving,
        .only_then = true,
        .low = 0},
    Key{.path = "oscillator.two_well.linear_n_m",
        .type = Type::parameter,
        .unit = "N/m",
        .sentence = "Magnets: the restoring force is -linear_n_m x + cubic_n_m3 x^3, not k x.",
        .need = Need::in_table,
        .when = moving,
        .only_then = true,
        .low = 0,
        .above_low = true},
    Key{.path = "oscillator.two_well.cubic_n_m3",
        .type = Type::parameter,
        .unit = "N/m^3",
        .sentence = "Magnets: cubic part of the restoring force.",
        .need = Need::in_table,
        .when = moving,
        .only_then = true,
        .low = 0,
        .above_low = true},
    Key{.path = "normal_load.law",
        .type = Type::choice,
        .sentence = "How the normal load comes about: N = load_n, N = max(0, load_n (1 + "
                    "slope_per_m x)), or the recorded channel. Without [normal_load]: N = 1 N.",
        .need = Need::in_table,
        .choices = "constant|wedge|measured"},
    Key{.path = "normal_load.load_n",
        .type = Type::parameter,
        .unit = "N",
        .sentence = "Normal load at x = 0, summed over both pads.",
        .need = Need::in_table,
        .when = "normal_load.law=constant|wedge",
        .only_then = true,
        .low = 0},
    Key{.path = "normal_load.slope_per_m",
        .type = Type::parameter,
        .unit = "1/m",
        .sentence = "Relative change of the normal load with deflection.",
        .need = Need::in_table,
        .when = "normal_load.law=wedge",
        .only_then = true},
    Key{.path = "friction.law",
        .type = Type::choice,
        .sentence = "theta of f = mu N theta: no friction, theta = g(v), or theta' = -rate_per_s "
                    "(theta - g(v)). Without [friction]: none.",
        .need = Need::in_table,
        .fallback = "none",
        .choices = "none|coulomb|state_variable"},
    Key{.path = "friction.mu",
        .type = Type::parameter,
        .unit = "1",
        .sentence = "Coefficient of friction; in N where no normal load is declared.",
        .need = Need::in_table,
        .when = rubbing,
        .only_then = true,
        .low = 0},
    Key{.path = "friction.transition_speed_m_s",
        .type = Type::parameter,
        .unit = "m/s",
        .sentence = "g(v) = tanh(v / transition_speed_m_s); 0: sign(v), and any value in [-1, 1] "
                    "while v = 0.",
        .need = Need::in_table,
        .when = rubbing,
        .only_then = true,
        .low = 0},
    Key{.path = "friction.rate_per_s",
        .type = Type::parameter,
        .unit = "1/s",
        .sentence = "Rate gamma at which theta follows g(v).",
        .need = Need::in_table,
        .when = "friction.law=state_variable",
        .only_then = true,
        .low = 0,
        .above_low = true},
    Key{.path = "load_cell.mass_kg",
        .type = Type::parameter,
        .unit = "kg",
        .sentence = "Mass that rides on the load cell. Without [load_cell]: rigid attachment.",
        .need = Need::in_table,
        .low = 0,
        .above_low = true},
    Key{.path = "load_cell.natural_frequency_hz",
        .type = Type::parameter,
        .unit = "Hz",
        .sentence = "Natural frequency of the load cell.",
        .need = Need::in_table,
        .low = 0,
        .above_low = true},
    Key{.path = "load_cell.damping_ratio",
        .type = Type::parameter,
        .unit = "1",
        .sentence = "Damping ratio of the load cell.",
        .need = Need::in_table,
        .low = 0},
    Key{.path = "load_cell.dynamics",
        .type = Type::choice,
        .sentence = "Eq. (1) of the paper taken as exact, or all of the load cell's equation.",
        .need = Need::in_table,
        .choices = "quasi_static|resonant"},
    Key{.path = "normal_load_bridge.mismatch",
        .type = Type::number,
        .unit = "1",
        .sentence = "Both pads' gauges sit in one bridge, which reads only v1 + v2: relative "
                    "difference of their calibrations, (c1 - c2) / (c1 + c2). Without "
                    "[normal_load_bridge]: the reading is N.",
        .need = Need::in_table,
        .low = -1,
        .above_low = true},
    Key{.path = "normal_load_bridge.share",
        .type = Type::number,
        .unit = "1",
        .sentence = "Share of the normal load on the first pad, at displacement 0.",
        .fallback = "0.5",
        .low = 0,
        .high = 1},
    Key{.path = "normal_load_bridge.share_slope_per_m",
        .type = Type::number,
        .unit = "1/m",
        .sentence = "Change of that share with displacement; it stays within 0 to 1.",
        .fallback = "0"},
    Key{.path = "sensors.*.noise_std",
        .type = Type::number,
        .unit = "the channel's",
        .sentence = "Standard deviation of the reading's white noise.",
        .fallback = "unknown: estimated",
        .low = 0,
        .above_low = true},
    Key{.path = "sensors.*.filters",
        .type = Type::filters,
        .sentence = "Analogue filters in the order of the signal; those of the velocity follow "
                    "those of the displacement.",
        .fallback = "none"},
    Key{.path = "physics",
        .type = Type::terms,
        .sentence = "One [[physics]] table for each term that a diagnosis added.",
        .fallback = "none"},
};

constexpr std::array filter_table = {
    Key{.path = "kind",
        .type = Type::choice,
        .sentence = "Shape of the filter.",
        .need = Need::always,
        .choices = "butterworth_lowpass|first_order_lowpass"},
    Key{.path = "order",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Number of poles.",
        .need = Need::always,
        .when = "kind=butterworth_lowpass",
        .only_then = true,
        .low = 1,
        .high = 8},
    Key{.path = "cutoff_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Frequency at which half the power is left.",
        .need = Need::always,
        .low = 0,
        .above_low = true},
};

constexpr std::array term_table = {
    Key{.path = "id",
        .type = Type::text,
        .sentence = "Effect of the catalogue; its parameters are the further keys, each a number "
                    "or { value, sigma }.",
        .need = Need::always},
    Key{.path = "channel",
        .type = Type::choice,
        .sentence = "The channel that is read wrongly; effects of the relation sensor only.",
        .choices =
            "displacement|velocity|friction_force|normal_load|base_displacement|drive_force"},
    Key{.path = "from",
        .type = Type::choice,
        .sentence = "The channel that leaks into it; crosstalk only.",
        .choices =
            "displacement|velocity|friction_force|normal_load|base_displacement|drive_force"},
};

constexpr std::array rig_table = {
    Key{.path = "schema",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Version of the format of this file.",
        .need = Need::always,
        .low = 1,
        .high = 1},
    Key{.path = "rig.name",
        .type = Type::text,
        .sentence = "Name of the rig; stands in every recording.",
        .need = Need::always},
    Key{.path = "rig.model",
        .type = Type::file,
        .sentence = "Model file: the physics that the rig's owner believes in. The observer "
                    "works with it.",
        .need = Need::always},
    Key{.path = "driver.kind",
        .type = Type::choice,
        .sentence = "The device that yields the channels.",
        .need = Need::always,
        .choices = "simulated|replay"},
    Key{.path = "driver.simulated.truth",
        .type = Type::file,
        .sentence = "Model file: what the simulated rig really does.",
        .fallback = "rig.model"},
    Key{.path = "driver.simulated.seed",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Seed of the sensor noise; the same seed, the same run.",
        .fallback = "1",
        .low = 0,
        .high = 9.0e15},
    Key{.path = "driver.simulated.noise",
        .type = Type::boolean,
        .sentence = "Whether the sensors have the noise that the truth declares.",
        .fallback = "true"},
    Key{.path = "driver.simulated.step_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "Longest integration step.",
        .fallback = "0.0001",
        .low = 1.0e-7,
        .high = 0.01},
    Key{.path = "driver.simulated.shaker_bandwidth_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Reconstruction filter and shaker together: a four-pole low-pass.",
        .fallback = "60",
        .low = 1,
        .high = 1.0e4},
    Key{.path = "driver.simulated.real_time",
        .type = Type::boolean,
        .sentence = "Whether a second of the rig takes a second; false: as fast as it goes.",
        .fallback = "true"},
    Key{.path = "driver.simulated.resolution.*",
        .type = Type::number,
        .unit = "the channel's",
        .sentence = "Step of the converter; 0: none.",
        .fallback = "0",
        .low = 0},
    Key{.path = "driver.replay.recording",
        .type = Type::file,
        .sentence = "Recording to play: CSV or LCM event log.",
        .need = Need::always,
        .when = "driver.kind=replay"},
    Key{.path = "driver.replay.speed",
        .type = Type::number,
        .unit = "1",
        .sentence = "1: as recorded, 10: ten times as fast, 0: as fast as it goes.",
        .fallback = "1",
        .low = 0,
        .high = 1.0e6},
    Key{.path = "loop.rate_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Cycles of the real-time loop, and frames, a second.",
        .fallback = "1000",
        .low = 1,
        .high = 2.0e4},
    Key{.path = "loop.frames_per_block",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Frames in one message.",
        .fallback = "10",
        .low = 1,
        .high = 1000},
    Key{.path = "loop.duration_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "Time after which the daemon stops by itself.",
        .fallback = "until told to stop",
        .low = 0,
        .above_low = true},
    Key{.path = "loop.real_time_scheduling",
        .type = Type::boolean,
        .sentence = "Whether real-time scheduling and locked memory are asked for; what is refused "
                    "is said.",
        .fallback = "true"},
    Key{.path = "calibration.*.offset",
        .type = Type::number,
        .unit = "raw",
        .sentence = "SI = (raw - offset) gain.",
        .fallback = "0",
        .live = true},
    Key{.path = "calibration.*.gain",
        .type = Type::number,
        .unit = "SI/raw",
        .sentence = "SI = (raw - offset) gain; not 0.",
        .fallback = "1",
        .live = true},
    Key{.path = "excitation.enabled",
        .type = Type::boolean,
        .sentence = "Whether the shaker is driven.",
        .fallback = "false",
        .live = true},
    Key{.path = "excitation.carrier_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Frequency of the drive, amplitude(t) sin(2 pi carrier_hz t); at most a "
                    "quarter of loop.rate_hz.",
        .fallback = "2.5",
        .low = 0,
        .high = 1000,
        .above_low = true,
        .live = true},
    Key{.path = "excitation.amplitude",
        .type = Type::number,
        .unit = "m or N",
        .sentence = "Largest amplitude: m of base displacement, at most 0.1, or N where a force "
                    "drives the rig; not with an envelope.",
        .fallback = "0",
        .low = 0,
        .live = true},
    Key{.path = "excitation.modulation_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Frequency of amplitude(t) = amplitude (1 - depth/2 + depth/2 cos(2 pi "
                    "modulation_hz t)); not with an envelope.",
        .fallback = "0",
        .low = 0,
        .high = 100,
        .live = true},
    Key{.path = "excitation.modulation_depth",
        .type = Type::number,
        .unit = "1",
        .sentence = "depth in it; 0: the amplitude is constant, 1: it goes down to zero; not with "
                    "an envelope.",
        .fallback = "0",
        .low = 0,
        .high = 1,
        .live = true},
    Key{.path = "excitation.envelope",
        .type = Type::envelope,
        .unit = "s, m or N",
        .sentence = "The amplitude over time: [[0.0, 0.002], [10.0, 0.012], ...], linear in "
                    "between, the first time 0.",
        .fallback = "none",
        .live = true},
    Key{.path = "excitation.repeat",
        .type = Type::boolean,
        .sentence = "Whether the envelope begins anew at its end; then it has to end as it begins.",
        .fallback = "true",
        .live = true},
    Key{.path = "excitation.ramp_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "Time from rest to full amplitude at the start, and back at the stop.",
        .fallback = "0.5",
        .low = 0,
        .high = 60,
        .live = true},
    Key{.path = "lcm.enabled",
        .type = Type::boolean,
        .sentence = "Whether frames, estimates and status are published.",
        .fallback = "true"},
    Key{.path = "lcm.url",
        .type = Type::text,
        .sentence = "LCM provider; ttl=0 keeps it on this host.",
        .fallback = "udpm://239.255.76.67:7667?ttl=0"},
    Key{.path = "recording.enabled",
        .type = Type::boolean,
        .sentence = "Whether the daemon records.",
        .fallback = "false"},
    Key{.path = "recording.file",
        .type = Type::file,
        .sentence = "LCM event log to write; its folder has to exist.",
        .need = Need::always,
        .when = "recording.enabled=true"},
    Key{.path = "observer.enabled",
        .type = Type::boolean,
        .sentence = "Whether friction is estimated while the rig runs.",
        .fallback = "true"},
    Key{.path = "metrics.file",
        .type = Type::file,
        .sentence = "Status for Prometheus, written once a second; named *.prom, in the folder "
                    "that node_exporter's textfile collector reads, which has to exist.",
        .fallback = "none is written"},
};

/// As a person writes it.
std::string bound_text(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string range_text(const Key& key) {
  const bool low = std::isfinite(key.low);
  const bool high = std::isfinite(key.high);
  if (low && high) {
    return key.low == key.high ? bound_text(key.low)
                               : (key.above_low ? "above " : "from ") + bound_text(key.low) +
                                     " to " + bound_text(key.high);
  }
  if (low) return key.above_low ? "above " + bound_text(key.low) : bound_text(key.low) + " or more";
  if (high) return bound_text(key.high) + " or less";
  return "";
}

std::string quoted_choices(std::string_view list, std::string_view last) {
  const auto choices = choices_of(list);
  std::string text;
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (i > 0) text += i + 1 == choices.size() ? last : ", ";
    text += '"' + std::string(choices[i]) + '"';
  }
  return text;
}

}  // namespace

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
      return "choice";
    case Type::file:
      return "path";
    case Type::parameter:
      return "parameter";
    case Type::filters:
      return "filters";
    case Type::envelope:
      return "points";
    case Type::terms:
      return "tables";
  }
  return "";
}

std::string range_of(const Key& key) {
  return key.type == Type::choice ? quoted_choices(key.choices, ", ") : range_text(key);
}

std::string absence_of(const Key& key) {
  if (key.need == Need::optional) return std::string(key.fallback);
  std::string text = "required";
  if (key.need == Need::in_table) {
    text += " in [" + std::string(key.path.substr(0, key.path.rfind('.'))) + "]";
  }
  if (!key.when.empty()) {
    const auto equals = key.when.find('=');
    const auto dot = key.when.substr(0, equals).rfind('.');
    const auto name = dot == std::string_view::npos ? key.when.substr(0, equals)
                                                    : key.when.substr(dot + 1, equals - dot - 1);
    text += " with " + std::string(name) + " ";
    for (char c : key.when.substr(equals + 1))
      text += c == '|' ? std::string(" or ") : std::string(1, c);
    if (key.only_then) text += "; not otherwise";
  }
  return text;
}

namespace {

/// `live`: with a column that says what a running daemon takes over.
void list(std::ostringstream& page, std::span<const Key> keys, bool live = false) {
  page << "| key | type | unit | range | without it |" << (live ? " live |" : "") << " meaning |\n"
       << "| --- | --- | --- | --- | --- |" << (live ? " --- |" : "") << " --- |\n";
  for (const Key& key : keys) {
    std::string path(key.path);
    const auto star = path.find('*');
    if (star != std::string::npos) path.replace(star, 1, "CHANNEL");
    page << "| `" << path << "` | " << name_of(key.type) << " | " << key.unit << " | "
         << range_of(key) << " | " << absence_of(key) << " | ";
    if (live) page << (key.live ? "yes" : "") << " | ";
    page << key.sentence << " |\n";
  }
}

}  // namespace

std::span<const Key> model_keys() { return model_table; }
std::span<const Key> filter_keys() { return filter_table; }
std::span<const Key> term_keys() { return term_table; }
std::span<const Key> rig_keys() { return rig_table; }

bool matches(const Key& key, std::string_view path) {
  const auto star = key.path.find('*');
  if (star == std::string_view::npos) return key.path == path;
  const std::string_view after = key.path.substr(star + 1);
  if (path.size() < star + after.size() || path.substr(0, star) != key.path.substr(0, star) ||
      path.substr(path.size() - after.size()) != after) {
    return false;
  }
  const std::string_view stem = path.substr(star, path.size() - star - after.size());
  for (const ChannelInfo& channel : channel_table) {
    if (channel.stem == stem) return true;
  }
  return false;
}

const Key* find_key(std::span<const Key> keys, std::string_view path) {
  for (const Key& key : keys) {
    if (matches(key, path)) return &key;
  }
  return nullptr;
}

std::vector<std::string_view> choices_of(std::string_view list) {
  std::vector<std::string_view> choices;
  while (!list.empty()) {
    const auto bar = list.find('|');
    choices.push_back(list.substr(0, bar));
    list = bar == std::string_view::npos ? std::string_view{} : list.substr(bar + 1);
  }
  return choices;
}

std::string_view choice_at(std::span<const Key> keys, std::string_view path, std::size_t position) {
  return choices_of(find_key(keys, path)->choices).at(position);
}

std::string number_text(double value) {
  std::array<char, 40> digits{};
  const double size = std::abs(value);
  const bool plain = size == 0.0 || (size >= 1.0e-4 && size < 1.0e9);
  const auto result =
      std::to_chars(digits.data(), digits.data() + digits.size(), value,
                    plain ? std::chars_format::fixed : std::chars_format::scientific);
  std::string text(digits.data(), result.ptr);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string string_text(std::string_view value) {
  std::string text = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      text += '\\';
      text += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      std::array<char, 8> escape{};
      std::snprintf(escape.data(), escape.size(), "\\u%04X", static_cast<unsigned>(c));
      text += escape.data();
    } else {
      text += c;
    }
  }
  return text + '"';
}

std::string expectation(const Key& key) {
  std::string text;
  switch (key.type) {
    case Type::number:
      text = "a number";
      break;
    case Type::integer:
      text = "a whole number";
      break;
    case Type::boolean:
      return "true or false";
    case Type::text:
      return "a text in quotes";
    case Type::choice:
      return quoted_choices(key.choices, " or ");
    case Type::file:
      return "the path of a file in quotes";
    case Type::parameter:
      text = "a number or { value = ..., sigma = ... }";
      break;
    case Type::filters:
      return "a list of filters, [ { kind = \"butterworth_lowpass\", order = 4, cutoff_hz = 25.0 } "
             "]";
    case Type::envelope:
      return "a list of points, [[time_s, amplitude], ...]";
    case Type::terms:
      return "[[physics]] tables";
  }
  const std::string range = range_text(key);
  if (!range.empty()) text += ", " + range;
  if (!key.unit.empty() && key.unit != "1" && key.unit.find(" or ") == std::string_view::npos &&
      key.unit.find("the ") != 0) {
    text += " [" + std::string(key.unit) + "]";
  }
  return text;
}

std::string keys_page() {
  std::ostringstream page;
  page << "# Configuration\n"
          "\n"
          "`stickslip check --keys` prints this page from the table that files are checked "
          "against; a\n"
          "test holds the two together.\n"
          "\n"
          "`stickslip check FILE...` tells everything that is wrong with a rig or a model at once, "
          "with\n"
          "line and column, without a daemon. Files are TOML. A key that does not exist is an "
          "error, so\n"
          "a misspelt one is never passed over in silence. CHANNEL stands for `displacement`,\n"
          "`velocity`, `friction_force`, `normal_load`, `base_displacement` or `drive_force`. "
          "Paths are\n"
          "relative to the file that names them.\n"
          "\n"
          "## Rigs\n"
          "\n"
          "What `stickslipd --config` reads; [`config/simulated.toml`](../config/simulated.toml) "
          "is one.\n"
          "`stickslip config RIG.toml --explain` tells the value of each key in a rig and where it "
          "comes\n"
          "from. Live: a running daemon takes a new value over when it is told to read its file "
          "again\n"
          "(`SIGHUP`); the others need a restart, and it says so.\n"
          "\n";
  list(page, rig_keys(), true);
  page << "\n"
          "## Models\n"
          "\n"
          "The physics that a rig's owner believes in, as in\n"
          "[`config/models/simulated.toml`](../config/models/simulated.toml). A parameter that is "
          "a\n"
          "plain number is known exactly; `{ value = 0.06, sigma = 0.0006 }` is known with that "
          "standard\n"
          "deviation and is calibrated on a recording before anything is called missing.\n"
          "\n";
  list(page, model_keys());
  page << "\n"
          "Each filter of `filters`:\n"
          "\n";
  list(page, filter_keys());
  page << "\n"
          "Each `[[physics]]` table:\n"
          "\n";
  list(page, term_keys());
  return page.str();
}

}  // namespace stickslip::config
