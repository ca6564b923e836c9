#include "config/rig.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "config/bench_document.h"
#include "config/demand.h"
#include "config/document.h"
#include "config/model_file.h"

namespace stickslip::config {

namespace {

constexpr double largest_base_amplitude_m = 0.1;

/// Sets `target` where the file says something.
template <class Target, class Value>
void take(Target& target, const std::optional<Value>& value) {
  if (value) target = static_cast<Target>(*value);
}

class Reader {
 public:
  explicit Reader(const std::filesystem::path& file)
      : file_(file), text_(read_text(file)), document_(text_, file.string(), rig_keys()) {}

  Rig read() {
    Rig rig;
    rig.file = file_;
    rig.text = text_;
    // The models are read even where the rig itself is not sound: all problems are told at once.
    const bool model = model_at("rig.model", rig.model_file, rig.model, rig.model_text);
    const bool truth = truth_of(rig, model);
    read_faults(rig);
    if (document_.sound()) {
      read_device(rig);
      read_safety(rig);
      read_excitation(rig.excitation);
      read_limits(rig.limits);
      read_outlets(rig);
      check(rig, truth);
    }
    if (!document_.sound()) throw InputError(document_.take_problems());
    return rig;
  }

 private:
  std::filesystem::path path_at(std::string_view path) const {
    std::filesystem::path named = document_.text(path).value_or("");
    if (named.empty() || named.is_absolute()) return named;
    return (file_.parent_path() / named).lexically_normal();
  }

  /// Whether a model could be read; every problem in it is told.
  bool model_at(std::string_view path, std::filesystem::path& file, physics::Model& model,
                std::string& text) {
    file = path_at(path);
    if (file.empty()) return false;
    try {
      text = read_text(file);
    } catch (const InputError& error) {
      document_.report(path, file.string() + ": " + error.problems().front().message);
      return false;
    }
    try {
      model = parse_model(text, file.string());
      return true;
    } catch (const InputError& error) {
      document_.add(error.problems());
      return false;
    }
  }

  bool truth_of(Rig& rig, bool model_is_sound) {
    const std::filesystem::path named = path_at("driver.simulated.truth");
    if (named.empty() || named == rig.model_file) {
      rig.simulated.truth = rig.model;
      rig.simulated.truth_file = rig.model_file;
      return model_is_sound;
    }
    std::string text;
    return model_at("driver.simulated.truth", rig.simulated.truth_file, rig.simulated.truth, text);
  }

  void read_faults(Rig& rig) {
    const std::filesystem::path named = path_at("driver.faults");
    if (named.empty()) return;
    std::string text;
    try {
      text = read_text(named);
    } catch (const InputError& error) {
      document_.report("driver.faults", error.problems().front().text());
      return;
    }
    try {
      rig.faults = parse_fault_script(text, named.string());
    } catch (const InputError& error) {
      document_.add(error.problems());
    }
  }

  void read_device(Rig& rig) {
    take(rig.name, document_.text("rig.name"));
    take(rig.driver, document_.choice("driver.kind"));
    take(rig.simulated.seed, document_.integer("driver.simulated.seed"));
    take(rig.simulated.noise, document_.boolean("driver.simulated.noise"));
    take(rig.simulated.step_s, document_.number("driver.simulated.step_s"));
    take(rig.simulated.shaker_bandwidth_hz,
         document_.number("driver.simulated.shaker_bandwidth_hz"));
    rig.simulated.relay = path_at("driver.simulated.relay");
    take(rig.simulated.real_time, document_.boolean("driver.simulated.real_time"));
    rig.replay.recording = path_at("driver.replay.recording");
    take(rig.replay.speed, document_.number("driver.replay.speed"));
    for (Channel channel : all_channels) {
      const std::string stem(info(channel).stem);
      take(rig.simulated.resolution[index_of(channel)],
           document_.number("driver.simulated.resolution." + stem));
    }
    if (rig.driver == DriverKind::bench) rig.bench = read_bench(document_, file_.parent_path());
    read_calibration(rig);
    take(rig.loop.rate_hz, document_.number("loop.rate_hz"));
    take(rig.loop.frames_per_block, document_.integer("loop.frames_per_block"));
    take(rig.loop.duration_s, document_.number("loop.duration_s"));
    take(rig.loop.real_time_scheduling, document_.boolean("loop.real_time_scheduling"));
    take(rig.loop.lateness_limit_s, document_.number("loop.lateness_limit_s"));
    take(rig.loop.priority, document_.integer("loop.priority"));
    if (const auto cpu = document_.integer("loop.cpu")) rig.loop.cpu = static_cast<int>(*cpu);
  }

  void read_safety(Rig& rig) {
    rig.control.socket = path_at("control.socket");
    take(rig.control.group, document_.text("control.group"));
    take(rig.control.start_at_once, document_.boolean("control.start_at_once"));
    Safety& safety = rig.safety;
    take(safety.longest_silence_s, document_.number("safety.longest_silence_s"));
    take(safety.stale_after_s, document_.number("safety.stale_after_s"));
    take(safety.longest_overrun_s, document_.number("safety.longest_overrun_s"));
    take(safety.dead_man_s, document_.number("safety.dead_man_s"));
    take(safety.not_finite, document_.boolean("safety.not_finite"));
    take(safety.observer_diverged, document_.boolean("safety.observer_diverged"));
    take(safety.recorder_failing, document_.boolean("safety.recorder_failing"));
    take(safety.exit_on_fault, document_.boolean("safety.exit_on_fault"));
    for (Channel channel : all_channels) {
      const std::string stem = "safety.range." + std::string(info(channel).stem);
      take(safety.range[index_of(channel)].low, document_.number(stem + ".low"));
      take(safety.range[index_of(channel)].high, document_.number(stem + ".high"));
    }
  }

  void read_calibration(Rig& rig) {
    rig.calibration_file = path_at("calibration.file");
    CalibrationFile of_file;
    if (!rig.calibration_file.empty()) {
      try {
        rig.calibration_text = read_text(rig.calibration_file);
        of_file = parse_calibration(rig.calibration_text, rig.calibration_file.string());
      } catch (const InputError& error) {
        if (rig.calibration_text.empty()) {
          document_.report("calibration.file",
                           rig.calibration_file.string() + ": " + error.problems().front().message);
        } else {
          document_.add(error.problems());
        }
      }
    }
    for (Channel channel : all_channels) {
      ChannelCalibration& calibration = rig.calibration[index_of(channel)];
      const std::string path = "calibration." + std::string(info(channel).stem);
      if (of_file.channel[index_of(channel)]) {
        calibration = *of_file.channel[index_of(channel)];
        if (document_.has(path)) {
          document_.report(path, "is in " + rig.calibration_file.string() +
                                     " as well, and only one can hold: take it out of one of the "
                                     "two");
        }
      }
      take(calibration.offset, document_.number(path + ".offset"));
      take(calibration.gain, document_.number(path + ".gain"));
    }
  }

  void read_excitation(Excitation& excitation) {
    take(excitation.enabled, document_.boolean("excitation.enabled"));
    take(excitation.carrier_hz, document_.number("excitation.carrier_hz"));
    take(excitation.amplitude, document_.number("excitation.amplitude"));
    take(excitation.modulation_hz, document_.number("excitation.modulation_hz"));
    take(excitation.modulation_depth, document_.number("excitation.modulation_depth"));
    excitation.envelope = document_.envelope("excitation.envelope");
    take(excitation.repeat, document_.boolean("excitation.repeat"));
    take(excitation.ramp_s, document_.number("excitation.ramp_s"));
    take(excitation.kind, document_.choice("excitation.kind"));
    take(excitation.by_hand.lowest, document_.number("excitation.by_hand.lowest"));
    take(excitation.by_hand.bandwidth_hz, document_.number("excitation.by_hand.bandwidth_hz"));
    take(excitation.by_hand.seed, document_.integer("excitation.by_hand.seed"));
    Sweep& sweep = excitation.sweep;
    take(sweep.from_hz, document_.number("excitation.sweep.from_hz"));
    take(sweep.to_hz, document_.number("excitation.sweep.to_hz"));
    take(sweep.duration_s, document_.number("excitation.sweep.duration_s"));
    take(sweep.scale, document_.choice("excitation.sweep.scale"));
    take(sweep.at_end, document_.choice("excitation.sweep.at_end"));
    take(sweep.pause_s, document_.number("excitation.sweep.pause_s"));
    take(sweep.taper_s, document_.number("excitation.sweep.taper_s"));
    excitation.multisine.lines = document_.lines("excitation.multisine.lines");
    take(excitation.multisine.count, document_.integer("excitation.multisine.count"));
    take(excitation.multisine.from_hz, document_.number("excitation.multisine.from_hz"));
    take(excitation.multisine.to_hz, document_.number("excitation.multisine.to_hz"));
    excitation.file.path = path_at("excitation.file.path");
    take(excitation.file.at_end, document_.choice("excitation.file.at_end"));
    excitation.amplitude_slew = document_.number("excitation.amplitude_slew");
    take(excitation.carrier_slew_hz_s, document_.number("excitation.carrier_slew_hz_s"));
    AmplitudeControl& control = excitation.control;
    take(control.enabled, document_.boolean("excitation.control.enabled"));
    take(control.gain_min, document_.number("excitation.control.gain_min"));
    take(control.gain_max, document_.number("excitation.control.gain_max"));
    take(control.time_constant_s, document_.number("excitation.control.time_constant_s"));
    take(control.distortion_max, document_.number("excitation.control.distortion_max"));
  }

  void read_limits(Limits& limits) {
    take(limits.displacement_m, document_.number("limits.displacement_m"));
    take(limits.velocity_m_s, document_.number("limits.velocity_m_s"));
    take(limits.acceleration_m_s2, document_.number("limits.acceleration_m_s2"));
    take(limits.force_n, document_.number("limits.force_n"));
    take(limits.force_slew_n_s, document_.number("limits.force_slew_n_s"));
  }

  void read_outlets(Rig& rig) {
    take(rig.lcm.enabled, document_.boolean("lcm.enabled"));
    take(rig.lcm.url, document_.text("lcm.url"));
    take(rig.recording.enabled, document_.boolean("recording.enabled"));
    rig.recording.file = path_at("recording.file");
    rig.recording.rotate_s = document_.number("recording.rotate_s");
    rig.recording.rotate_mb = document_.number("recording.rotate_mb");
    take(rig.recording.sync_s, document_.number("recording.sync_s"));
    take(rig.observer.enabled, document_.boolean("observer.enabled"));
    take(rig.observer.model_check, document_.boolean("observer.model_check"));
    take(rig.observer.days_between_false_alarms,
         document_.number("observer.days_between_false_alarms"));
    rig.metrics.file = path_at("metrics.file");
  }

  // What the keys of the file mean together.

  void check(const Rig& rig, bool truth_is_sound) {
    if (rig.driver == DriverKind::simulated && truth_is_sound) check_truth(rig);
    if (rig.driver == DriverKind::replay) check_replay(rig);
    if (rig.driver == DriverKind::bench) {
      check_bench(document_, rig);
    } else {
      refuse_bench(document_);
    }
    check_calibration(rig);
    check_safety(rig);
    check_excitation(rig);
    check_outlets(rig);
  }

  void check_truth(const Rig& rig) {
    const physics::Model& truth = rig.simulated.truth;
    const std::string_view path =
        document_.has("driver.simulated.truth") ? "driver.simulated.truth" : "rig.model";
    if (truth.oscillator.excitation == physics::Excitation::imposed) {
      document_.report(path, rig.simulated.truth_file.string() +
                                 " has an imposed motion, which no simulated shaker can give: "
                                 "expected excitation \"base\" or \"force\"");
    }
    if (truth.normal_load && truth.normal_load->law == physics::NormalLoadLaw::measured) {
      document_.report(path, rig.simulated.truth_file.string() +
                                 " takes its normal load from a recording, and a simulated rig has "
                                 "none: expected the law \"constant\" or \"wedge\"");
    }
    if (truth.oscillator.excitation != rig.model.oscillator.excitation) {
      document_.report(path, rig.simulated.truth_file.string() + " and " + rig.model_file.string() +
                                 " do not agree on oscillator.excitation: one rig has one drive");
    }
  }

  void check_replay(const Rig& rig) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(rig.replay.recording, error)) {
      document_.report("driver.replay.recording",
                       rig.replay.recording.string() + ": there is no such file");
    }
  }

  void check_calibration(const Rig& rig) {
    for (Channel channel : all_channels) {
      const ChannelCalibration& calibration = rig.calibration[index_of(channel)];
      const std::string path = "calibration." + std::string(info(channel).stem);
      if (calibration.gain == 0.0) {
        document_.report(path + ".gain", "is 0, so that every reading would be 0");
      }
      const bool own = document_.has(path) || rig.calibration_file.empty();
      if (rig.driver == DriverKind::replay && calibration != ChannelCalibration{}) {
        document_.report(own ? path : "calibration.file",
                         "a recording is in SI units already: leave the calibration out "
                         "while driver.kind is \"replay\"");
      }
    }
  }

  void check_safety(const Rig& rig) {
    if (rig.control.start_at_once && rig.driver != DriverKind::simulated) {
      document_.report("control.start_at_once",
                       "only a simulated rig may start by itself: on this one a person does, with "
                       "`stickslip ctl clear`, `arm` and `start`");
    }
    for (Channel channel : all_channels) {
      const ChannelRange& range = rig.safety.range[index_of(channel)];
      if (range.low >= range.high) {
        document_.report("safety.range." + std::string(info(channel).stem),
                         "leaves nothing: low has to be below high");
      }
    }
  }

  void check_excitation(const Rig& rig) {
    const Excitation& excitation = rig.excitation;
    const std::size_t problems_before = document_.problem_count();
    check_kind(excitation);
    const bool sound = document_.problem_count() == problems_before;
    if (!excitation.envelope.empty()) {
      for (const char* name : {"amplitude", "modulation_hz", "modulation_depth"}) {
        const std::string path = std::string("excitation.") + name;
        if (document_.has(path)) {
          document_.report(path, "does nothing beside an envelope: keep one of the two");
        }
      }
      if (excitation.repeat &&
          excitation.envelope.front().amplitude != excitation.envelope.back().amplitude) {
        document_.report("excitation.envelope",
                         "ends on another amplitude than it begins with, and the drive would jump "
                         "there: make them equal, or set repeat = false");
      }
    }
    if (!sound) return;
    if (highest_frequency_hz(excitation) > rig.loop.rate_hz / 4.0) {
      document_.report(place_of_frequency(excitation),
                       "is more than a quarter of loop.rate_hz: the drive would be no sine");
    }
    check_limits(rig);
  }

  /// What the kind of excitation needs, and what it has no use for.
  void check_kind(const Excitation& excitation) {
    using enum ExcitationKind;
    const ExcitationKind kind = excitation.kind;
    const bool lines = kind == multisine && !excitation.multisine.lines.empty();
    const auto useless = [this](bool used, const char* name, const std::string& why) {
      const std::string path = std::string("excitation.") + name;
      if (!used && document_.has(path))
        document_.report(path, "does nothing " + why + ": remove it");
    };
    const std::string with_kind =
        "with kind = \"" +
        std::string(choice_at(rig_keys(), "excitation.kind", static_cast<std::size_t>(kind))) + '"';
    for (const char* name : {"modulation_hz", "modulation_depth", "envelope", "repeat"}) {
      useless(kind == modulated, name, with_kind);
    }
    useless(kind == modulated || kind == by_hand, "carrier_hz", with_kind);
    useless(kind != file, "amplitude", with_kind);
    useless(!lines, "amplitude", "beside multisine.lines");
    if (kind == by_hand && excitation.by_hand.lowest > excitation.amplitude) {
      document_.report("excitation.by_hand.lowest", "is above excitation.amplitude");
    }
    if (kind == chirp && excitation.sweep.taper_s > excitation.sweep.duration_s / 2.0) {
      document_.report("excitation.sweep.taper_s",
                       "is more than half of duration_s: a burst swells, and then fades");
    }
    if (kind == multisine) check_multisine(excitation.multisine);
    if (kind == file) {
      std::error_code error;
      if (!std::filesystem::is_regular_file(excitation.file.path, error)) {
        document_.report("excitation.file.path",
                         excitation.file.path.string() + ": there is no such file");
      }
    }
    if (excitation.control.enabled && (kind == multisine || kind == file)) {
      document_.report("excitation.control.enabled",
                       "needs a carrier, and there is none " + with_kind);
    }
  }

  void check_multisine(const Multisine& multisine) {
    const bool numbers = document_.has("excitation.multisine.count") ||
                         document_.has("excitation.multisine.from_hz") ||
                         document_.has("excitation.multisine.to_hz");
    if (!multisine.lines.empty()) {
      if (numbers) {
        document_.report("excitation.multisine",
                         "expected lines, or count, from_hz and to_hz: not both");
      }
      return;
    }
    if (multisine.count < 2 || multisine.from_hz <= 0.0 || multisine.to_hz <= 0.0) {
      document_.report("excitation.multisine",
                       "a multisine needs lines, or count, from_hz and to_hz");
    } else if (multisine.from_hz >= multisine.to_hz) {
      document_.report("excitation.multisine.from_hz", "is not below to_hz");
    }
  }

  static const char* place_of_frequency(const Excitation& excitation) {
    switch (excitation.kind) {
      case ExcitationKind::sweep:
      case ExcitationKind::chirp:
        return excitation.sweep.from_hz > excitation.sweep.to_hz ? "excitation.sweep.from_hz"
                                                                 : "excitation.sweep.to_hz";
      case ExcitationKind::multisine:
        return excitation.multisine.lines.empty() ? "excitation.multisine.to_hz"
                                                  : "excitation.multisine.lines";
      default:
        return "excitation.carrier_hz";
    }
  }

  void check_limits(const Rig& rig) {
    const Excitation& excitation = rig.excitation;
    const Limits& limits = rig.limits;
    const bool force = rig.model.oscillator.excitation == physics::Excitation::force;
    const std::string place =
        excitation.kind == ExcitationKind::multisine && !excitation.multisine.lines.empty()
            ? "excitation.multisine.lines"
        : excitation.envelope.empty() ? "excitation.amplitude"
                                      : "excitation.envelope";
    const Demand demand = demand_of(excitation);
    if (!force && demand.displacement > largest_base_amplitude_m) {
      document_.report(place, "moves the base by more than 0.1 m: amplitudes are in metres");
      return;
    }
    // Below, the acceleration of a cycle is lost in the rounding of the position.
    constexpr double least_change = 2.0e-11;
    const double rate = rig.loop.rate_hz;
    if (!force && limits.acceleration_m_s2 / (rate * rate) < least_change * limits.displacement_m) {
      document_.report("limits.acceleration_m_s2",
                       "is too small to be kept at this loop.rate_hz: expected " +
                           short_number(least_change * limits.displacement_m * rate * rate) +
                           " or more");
    }
    if (const auto excess = excess_of(demand, limits, force)) {
      document_.report(place, "asks for " + text_of(*excess) + ": " +
                                  short_number(100.0 * excess->limit / excess->demand) +
                                  " % of the amplitude would do");
    }
  }

  void check_outlets(const Rig& rig) {
    const std::string& url = rig.lcm.url;
    bool known = false;
    for (const char* provider : {"udpm:", "memq:", "file:", "tcpq:", "mpudpm:"}) {
      known = known || url.starts_with(provider);
    }
    if (!known || url.find("://") == std::string::npos) {
      document_.report("lcm.url",
                       "expected udpm://ADDRESS:PORT?ttl=N, memq://, tcpq://HOST:PORT or "
                       "file://PATH, found \"" +
                           url + "\"");
    }
    if (rig.recording.enabled) expect_folder_of("recording.file", rig.recording.file);
    if (!rig.metrics.file.empty()) {
      if (rig.metrics.file.extension() != ".prom") {
        document_.report("metrics.file",
                         "node_exporter reads only files named *.prom, and passes over " +
                             rig.metrics.file.filename().string() + " without a word");
      }
      expect_folder_of("metrics.file", rig.metrics.file);
    }
  }

  void expect_folder_of(std::string_view path, const std::filesystem::path& file) {
    std::error_code error;
    const std::filesystem::path folder =
        file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
    if (!std::filesystem::is_directory(folder, error)) {
      document_.report(path, "there is no folder " + folder.string());
    }
  }

  std::filesystem::path file_;
  std::string text_;
  Document document_;
};

}  // namespace

Rig load_rig(const std::filesystem::path& file) { return Reader(file).read(); }

}  // namespace stickslip::config
