#include "config/rig.h"

#include "config/document.h"
#include "config/key.h"
#include "config/model_file.h"

namespace stickslip::config {

namespace {

// A model file that a rig names. Its own problems are added to the rig's.
physics::Model load_named(Document& document, const std::string& path,
                          const std::filesystem::path& file, std::string* text,
                          std::vector<Problem>& problems) {
  try {
    const std::string content = file_text(file);
    if (text != nullptr) *text = content;
    return parse_model(content, file.string());
  } catch (const InputError& error) {
    const bool unreadable = error.problems().front().line == 0 && error.problems().size() == 1;
    if (unreadable) {
      document.blame(path, "names " + error.problems().front().text());
    } else {
      problems.insert(problems.end(), error.problems().begin(), error.problems().end());
    }
  }
  return {};
}

void read_driver(Document& document, Rig& rig, const std::filesystem::path& folder,
                 std::vector<Problem>& problems) {
  document.require("driver.kind");
  if (document.text("driver.kind") == "replay") {
    rig.driver = DriverKind::replay;
    document.require("driver.replay.recording", "the driver \"replay\" plays it");
    if (const auto file = document.text("driver.replay.recording")) {
      rig.replay.recording = folder / *file;
      if (!std::filesystem::exists(rig.replay.recording)) {
        document.blame("driver.replay.recording",
                       "names " + rig.replay.recording.string() + ", which does not exist");
      }
    }
    rig.replay.speed = document.number("driver.replay.speed").value_or(1.0);
    return;
  }
  SimulatedDriver& simulated = rig.simulated;
  if (const auto truth = document.text("driver.simulated.truth")) {
    simulated.truth_file = folder / *truth;
    simulated.truth =
        load_named(document, "driver.simulated.truth", simulated.truth_file, nullptr, problems);
  } else {
    simulated.truth_file = rig.model_file;
    simulated.truth = rig.model;
  }
  if (simulated.truth.oscillator.excitation == physics::Excitation::imposed) {
    document.blame(
        "driver.simulated.truth",
        "is a model with imposed motion; a simulated rig needs one that is driven (excitation = "
        "\"base\" or \"force\")");
  }
  simulated.seed =
      static_cast<std::uint64_t>(document.integer("driver.simulated.seed").value_or(1));
  simulated.noise = document.boolean("driver.simulated.noise").value_or(true);
  simulated.step_s = document.number("driver.simulated.step_s").value_or(1.0e-4);
  simulated.shaker_bandwidth_hz =
      document.number("driver.simulated.shaker_bandwidth_hz").value_or(60.0);
  simulated.real_time = document.boolean("driver.simulated.real_time").value_or(true);
  for (const Channel channel : all_channels) {
    simulated.resolution[index_of(channel)] =
        document.number("driver.simulated.resolution." + std::string(info(channel).stem))
            .value_or(0.0);
  }
}

void read_excitation(Document& document, Rig& rig) {
  Excitation& excitation = rig.excitation;
  excitation.enabled = document.boolean("excitation.enabled").value_or(false);
  excitation.carrier_hz = document.number("excitation.carrier_hz").value_or(2.5);
  excitation.amplitude = document.number("excitation.amplitude").value_or(0.0);
  excitation.modulation_hz = document.number("excitation.modulation_hz").value_or(0.0);
  excitation.modulation_depth = document.number("excitation.modulation_depth").value_or(0.0);
  for (const auto& [time_s, amplitude] : document.envelope("excitation.envelope")) {
    excitation.envelope.push_back({time_s, amplitude});
  }
  excitation.repeat = document.boolean("excitation.repeat").value_or(true);
  excitation.ramp_s = document.number("excitation.ramp_s").value_or(0.5);
  if (!excitation.envelope.empty()) {
    for (const char* path :
         {"excitation.amplitude", "excitation.modulation_hz", "excitation.modulation_depth"}) {
      if (document.has(path))
        document.blame(path, "stands beside an envelope, which says it all: remove one");
    }
  }
  if (excitation.carrier_hz >= 0.5 * rig.loop.rate_hz) {
    document.blame("excitation.carrier_hz",
                   "is not below half of loop.rate_hz: the loop cannot draw it");
  }
}

}  // namespace

Rig load_rig(const std::filesystem::path& file) {
  Rig rig;
  rig.file = file;
  rig.text = file_text(file);
  Document document(rig.text, file.string(), rig_keys());
  std::vector<Problem> of_models;
  if (document.sound()) {
    const std::filesystem::path folder = file.parent_path();
    document.require("schema", "write schema = 1");
    document.require("rig.name");
    rig.name = document.text("rig.name").value_or("");
    document.require("rig.model");
    if (const auto model = document.text("rig.model")) {
      rig.model_file = folder / *model;
      rig.model = load_named(document, "rig.model", rig.model_file, &rig.model_text, of_models);
    }
    rig.loop.rate_hz = document.number("loop.rate_hz").value_or(1000.0);
    rig.loop.frames_per_block =
        static_cast<int>(document.integer("loop.frames_per_block").value_or(10));
    rig.loop.duration_s = document.number("loop.duration_s");
    rig.loop.real_time_scheduling = document.boolean("loop.real_time_scheduling").value_or(true);
    read_driver(document, rig, folder, of_models);
    for (const Channel channel : all_channels) {
      const std::string path = "calibration." + std::string(info(channel).stem);
      ChannelCalibration& calibration = rig.calibration[index_of(channel)];
      calibration.offset = document.number(path + ".offset").value_or(0.0);
      calibration.gain = document.number(path + ".gain").value_or(1.0);
      if (calibration.gain == 0.0) document.blame(path + ".gain", "is 0: every reading would be 0");
    }
    read_excitation(document, rig);
    rig.lcm.enabled = document.boolean("lcm.enabled").value_or(true);
    rig.lcm.url = document.text("lcm.url").value_or(rig.lcm.url);
    rig.recording.enabled = document.boolean("recording.enabled").value_or(false);
    if (rig.recording.enabled) document.require("recording.file", "recording.enabled asks for it");
    if (const auto recording = document.text("recording.file"))
      rig.recording.file = folder / *recording;
    rig.observer.enabled = document.boolean("observer.enabled").value_or(true);
  }
  std::vector<Problem> problems = document.problems();
  problems.insert(problems.end(), of_models.begin(), of_models.end());
  if (!problems.empty()) throw InputError(problems);
  return rig;
}

}  // namespace stickslip::config
