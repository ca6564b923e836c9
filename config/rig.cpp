// SPDX-License-Identifier: Apache-2.0
#include "config/rig.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "config/bench_document.h"
#include "config/demand.h"
#include "config/document.h"
#include "config/lcm_url.h"
#include "config/model_file.h"
#include "config/named_files.h"
#include "physics/integration_cost.h"

namespace stickslip::config {

namespace {

constexpr double largest_base_amplitude_m = 0.1;

class Reader {
 public:
  explicit Reader(const std::filesystem::path& file)
      : file_(file), text_(read_text(file)), document_(text_, file.string(), rig_keys()) {}

  Rig read() {
    Rig rig;
    rig.file = file_;
    rig.text = text_;
    // The files that it names are read even if the rig has problems, to report those of all files.
    const bool model = read_model("rig.model", rig.model_file, rig.model, rig.model_text);
    const bool truth = read_truth(rig, model);
    read_faults(rig);
    if (document_.sound()) {
      document_.read(rig);
      if (rig.driver == DriverKind::bench) complete_bench(document_, rig);
      read_calibration(rig);
      check(rig, truth);
    }
    if (!document_.sound()) throw InputError(document_.take_problems());
    rig.warnings = document_.warnings();
    return rig;
  }

 private:
  /// False if the model has problems, which are reported.
  bool read_model(std::string_view path, std::filesystem::path& file, physics::Model& model,
                  std::string& text) {
    file = document_.file_at(path);
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

  bool read_truth(Rig& rig, bool model_is_sound) {
    const std::filesystem::path named = document_.file_at("driver.simulated.truth");
    if (named.empty() || named == rig.model_file) {
      rig.simulated.truth = rig.model;
      rig.simulated.truth_file = rig.model_file;
      return model_is_sound;
    }
    std::string text;
    return read_model("driver.simulated.truth", rig.simulated.truth_file, rig.simulated.truth,
                      text);
  }

  void read_faults(Rig& rig) {
    const std::filesystem::path named = document_.file_at("driver.faults");
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

  /// The calibration file, whose channels must not be calibrated in the rig file as well.
  void read_calibration(Rig& rig) {
    if (rig.calibration_file.empty()) return;
    CalibrationFile calibration;
    try {
      rig.calibration_text = read_text(rig.calibration_file);
      calibration = parse_calibration(rig.calibration_text, rig.calibration_file.string());
    } catch (const InputError& error) {
      if (rig.calibration_text.empty()) {
        document_.report("calibration.file",
                         rig.calibration_file.string() + ": " + error.problems().front().message);
      } else {
        document_.add(error.problems());
      }
    }
    for (Channel channel : all_channels) {
      if (!calibration.channel[index_of(channel)]) continue;
      rig.calibration[index_of(channel)] = *calibration.channel[index_of(channel)];
      const std::string path = "calibration." + std::string(info(channel).stem);
      if (document_.has(path)) {
        document_.report(path, "is in " + rig.calibration_file.string() +
                                   " as well: remove it from one of the two");
      }
    }
  }

  // Consistency of the keys with each other.

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
    check_outputs(rig);
  }

  void check_truth(const Rig& rig) {
    const physics::Model& truth = rig.simulated.truth;
    const std::string_view path =
        document_.has("driver.simulated.truth") ? "driver.simulated.truth" : "rig.model";
    if (truth.oscillator.excitation == physics::Excitation::imposed) {
      document_.report(path, rig.simulated.truth_file.string() +
                                 " has an imposed motion, which a simulated shaker cannot "
                                 "produce: expected excitation \"base\" or \"force\"");
    }
    if (truth.normal_load && truth.normal_load->law == physics::NormalLoadLaw::measured) {
      document_.report(path, rig.simulated.truth_file.string() +
                                 " takes its normal load from a recording, which a simulated rig "
                                 "does not have: expected the law \"constant\" or \"wedge\"");
    }
    const std::string too_fast = physics::wrong_with_simulation(truth, 0.0);
    if (!too_fast.empty())
      document_.report(path, rig.simulated.truth_file.string() + ": " + too_fast);
    if (truth.oscillator.excitation != rig.model.oscillator.excitation) {
      document_.report(path, rig.simulated.truth_file.string() + " and " + rig.model_file.string() +
                                 " differ in oscillator.excitation: a rig has a single drive");
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
        document_.report(path + ".gain", "is 0: every reading would be 0");
      }
      const bool in_rig_file = document_.has(path) || rig.calibration_file.empty();
      if (rig.driver == DriverKind::replay && calibration != ChannelCalibration{}) {
        document_.report(in_rig_file ? path : "calibration.file",
                         "a recording is in SI units already: remove the calibration "
                         "while driver.kind is \"replay\"");
      }
    }
  }

  void check_safety(const Rig& rig) {
    if (rig.control.start_at_once && rig.driver != DriverKind::simulated) {
      document_.report("control.start_at_once",
                       "only a simulated rig may start automatically; start this one with "
                       "`stickslip ctl clear`, `arm` and `start`");
    }
    for (Channel channel : all_channels) {
      const ChannelRange& range = rig.safety.range[index_of(channel)];
      if (range.low >= range.high) {
        document_.report("safety.range." + std::string(info(channel).stem),
                         "is empty: low has to be below high");
      }
    }
  }

  void check_excitation(const Rig& rig) {
    const Excitation& excitation = rig.excitation;
    const std::size_t problems_before = document_.problem_count();
    check_kind(excitation);
    const bool valid = document_.problem_count() == problems_before;
    if (!excitation.envelope.empty()) {
      for (const char* name : {"amplitude", "modulation_hz", "modulation_depth"}) {
        const std::string path = std::string("excitation.") + name;
        if (document_.has(path)) {
          document_.report(path, "has no effect with an envelope: remove one of the two");
        }
      }
      if (excitation.repeat &&
          excitation.envelope.front().amplitude != excitation.envelope.back().amplitude) {
        document_.report("excitation.envelope",
                         "ends at another amplitude than it begins with, and the drive would "
                         "jump: make them equal, or set repeat = false");
      }
    }
    if (!valid) return;
    if (highest_frequency_hz(excitation) > rig.loop.rate_hz / 4.0) {
      document_.report(place_of_frequency(excitation),
                       "is more than a quarter of loop.rate_hz: the drive would not be a sine");
    }
    check_limits(rig);
  }

  /// Keys that the kind of excitation requires, and keys that it ignores.
  void check_kind(const Excitation& excitation) {
    using enum ExcitationKind;
    const ExcitationKind kind = excitation.kind;
    const bool lines = kind == multisine && !excitation.multisine.lines.empty();
    const auto check_used = [this](bool used, const char* name, const std::string& why) {
      const std::string path = std::string("excitation.") + name;
      if (!used && document_.has(path))
        document_.report(path, "has no effect " + why + ": remove it");
    };
    const std::string with_kind = "with kind = \"" + std::string(name_of(kind)) + '"';
    for (const char* name : {"modulation_hz", "modulation_depth", "envelope", "repeat"}) {
      check_used(kind == modulated, name, with_kind);
    }
    check_used(kind == modulated || kind == by_hand, "carrier_hz", with_kind);
    check_used(kind != file, "amplitude", with_kind);
    check_used(!lines, "amplitude", "with multisine.lines");
    if (kind == by_hand && excitation.by_hand.lowest > excitation.amplitude) {
      document_.report("excitation.by_hand.lowest", "is above excitation.amplitude");
    }
    if (kind == chirp && excitation.sweep.taper_s > excitation.sweep.duration_s / 2.0) {
      document_.report("excitation.sweep.taper_s",
                       "is more than half of duration_s, which has to hold the rise and the decay");
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
      document_.report("excitation.control.enabled", "needs a carrier; there is none " + with_kind);
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
    // Below this the change of position in a cycle is lost in rounding.
    constexpr double min_change = 2.0e-11;
    const double rate = rig.loop.rate_hz;
    if (!force && limits.acceleration_m_s2 / (rate * rate) < min_change * limits.displacement_m) {
      document_.report("limits.acceleration_m_s2",
                       "is too small to be enforced at this loop.rate_hz: expected " +
                           short_number(min_change * limits.displacement_m * rate * rate) +
                           " or more");
    }
    if (const auto excess = excess_of(demand, limits, force)) {
      document_.report(place, "requires " + text_of(*excess) + ": " +
                                  short_number(100.0 * excess->limit / excess->demand) +
                                  " % of the amplitude is allowed");
    }
  }

  void check_outputs(const Rig& rig) {
    const std::string wrong = wrong_with_lcm_url(rig.lcm.url);
    if (!wrong.empty()) document_.report("lcm.url", wrong);
    if (rig.recording.enabled) check_folder_of("recording.file", rig.recording.file);
    if (!rig.metrics.file.empty()) {
      if (rig.metrics.file.extension() != ".prom") {
        document_.report("metrics.file",
                         "node_exporter reads only files named *.prom, and silently ignores " +
                             rig.metrics.file.filename().string());
      }
      check_folder_of("metrics.file", rig.metrics.file);
    }
    if (rig.recording.enabled) check_written(rig, "recording.file", rig.recording.file);
    check_written(rig, "metrics.file", rig.metrics.file);
    check_written(rig, "control.socket", rig.control.socket);
  }

  void check_written(const Rig& rig, const std::string& key, const std::filesystem::path& file) {
    if (file.empty()) return;
    const std::string wrong = wrong_with_output(rig, key, file);
    if (!wrong.empty()) document_.report(key, wrong);
  }

  void check_folder_of(std::string_view path, const std::filesystem::path& file) {
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
