#include "config/rig.h"

#include <algorithm>
#include <system_error>
#include <utility>

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
    if (document_.sound()) {
      read_device(rig);
      read_excitation(rig.excitation);
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

  void read_device(Rig& rig) {
    take(rig.name, document_.text("rig.name"));
    take(rig.driver, document_.choice("driver.kind"));
    take(rig.simulated.seed, document_.integer("driver.simulated.seed"));
    take(rig.simulated.noise, document_.boolean("driver.simulated.noise"));
    take(rig.simulated.step_s, document_.number("driver.simulated.step_s"));
    take(rig.simulated.shaker_bandwidth_hz,
         document_.number("driver.simulated.shaker_bandwidth_hz"));
    take(rig.simulated.real_time, document_.boolean("driver.simulated.real_time"));
    rig.replay.recording = path_at("driver.replay.recording");
    take(rig.replay.speed, document_.number("driver.replay.speed"));
    for (Channel channel : all_channels) {
      const std::string stem(info(channel).stem);
      take(rig.simulated.resolution[index_of(channel)],
           document_.number("driver.simulated.resolution." + stem));
      ChannelCalibration& calibration = rig.calibration[index_of(channel)];
      take(calibration.offset, document_.number("calibration." + stem + ".offset"));
      take(calibration.gain, document_.number("calibration." + stem + ".gain"));
    }
    take(rig.loop.rate_hz, document_.number("loop.rate_hz"));
    take(rig.loop.frames_per_block, document_.integer("loop.frames_per_block"));
    take(rig.loop.duration_s, document_.number("loop.duration_s"));
    take(rig.loop.real_time_scheduling, document_.boolean("loop.real_time_scheduling"));
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
  }

  void read_outlets(Rig& rig) {
    take(rig.lcm.enabled, document_.boolean("lcm.enabled"));
    take(rig.lcm.url, document_.text("lcm.url"));
    take(rig.recording.enabled, document_.boolean("recording.enabled"));
    rig.recording.file = path_at("recording.file");
    take(rig.observer.enabled, document_.boolean("observer.enabled"));
    rig.metrics.file = path_at("metrics.file");
  }

  // What the keys of the file mean together.

  void check(const Rig& rig, bool truth_is_sound) {
    if (rig.driver == DriverKind::simulated && truth_is_sound) check_truth(rig);
    if (rig.driver == DriverKind::replay) check_replay(rig);
    check_calibration(rig);
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
      if (rig.driver == DriverKind::replay && calibration != ChannelCalibration{}) {
        document_.report(path,
                         "a recording is in SI units already: leave the calibration out "
                         "while driver.kind is \"replay\"");
      }
    }
  }

  void check_excitation(const Rig& rig) {
    const Excitation& excitation = rig.excitation;
    if (excitation.carrier_hz > rig.loop.rate_hz / 4.0) {
      document_.report("excitation.carrier_hz",
                       "is more than a quarter of loop.rate_hz: the drive would be no sine");
    }
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
    if (rig.model.oscillator.excitation != physics::Excitation::base) return;
    double largest = excitation.amplitude;
    for (const EnvelopePoint& point : excitation.envelope) {
      largest = std::max(largest, point.amplitude);
    }
    if (largest > largest_base_amplitude_m) {
      document_.report(excitation.envelope.empty() ? "excitation.amplitude" : "excitation.envelope",
                       "moves the base by more than 0.1 m: amplitudes are in metres");
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
