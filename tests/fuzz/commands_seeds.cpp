// SPDX-License-Identifier: Apache-2.0
// Writes the seeds of fuzz_commands: every command with small recordings of three kinds of rigs.
//   commands_seeds MODELS FOLDER     MODELS: folder of the models that are shipped
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <numbers>
#include <sstream>
#include <string>

#include "config/model_file.h"
#include "physics/simulator.h"
#include "protocol/recording.h"

namespace {

namespace fs = std::filesystem;
using namespace stickslip;

std::string content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

protocol::Recording recorded(const physics::Model& model, int samples, double period_s) {
  physics::RigSimulator simulator(model, {});
  protocol::Recording out;
  for (int k = 0; k < samples; ++k) {
    const double omega = 2.0 * std::numbers::pi * 4.2;
    const double t = period_s * k;
    physics::Input input;
    input.base_displacement_m = 0.008 * std::sin(omega * t);
    input.base_acceleration_m_s2 = -omega * omega * input.base_displacement_m;
    input.drive_force_n = 2.0 * std::sin(omega * t);
    input.displacement_m = 0.01 * std::sin(omega * t);
    input.velocity_m_s = 0.01 * omega * std::cos(omega * t);
    input.normal_load_n = 0.5;
    if (k == 0) {
      simulator.set_input(input);
    } else {
      simulator.advance(period_s, input);
    }
    Frame frame = simulator.read();
    frame.time_ns = std::llround(t * 1e9);
    frame.sequence = static_cast<std::uint64_t>(k);
    out.channels |= frame.valid;
    out.frames.push_back(frame);
  }
  out.description = {1, "bench", "stickslipd", "0.1.0", "[rig]\n", "schema = 1\n"};
  return out;
}

/// The recording with every value of a channel replaced.
protocol::Recording with(protocol::Recording recording, Channel channel, double value) {
  for (Frame& frame : recording.frames) frame.set(channel, value);
  recording.channels = static_cast<std::uint8_t>(recording.channels | (1U << index_of(channel)));
  return recording;
}

std::string as_csv(const protocol::Recording& recording) {
  std::ostringstream out;
  protocol::write_csv(recording, out);
  return out.str();
}

std::string as_log(const protocol::Recording& recording, const fs::path& folder) {
  const fs::path file = folder / "temporary.log";
  protocol::write_log(recording, file);
  std::string out = content(file);
  fs::remove(file);
  return out;
}

void write_seeds(const fs::path& models, const fs::path& folder) {
  fs::create_directories(folder);
  const auto seed = [&](const std::string& commands, const std::string& name,
                        const std::string& model, const std::string& recording) {
    for (const char command : commands) {
      std::ofstream(folder / (std::string(1, command) + "_" + name), std::ios::binary)
          << command << '\n'
          << model << "\n%%\n"
          << recording;
    }
  };
  const std::string beam = content(models / "beam-1.toml");
  const protocol::Recording base = recorded(config::parse_model(beam, "beam"), 96, 0.01);
  seed("abcdemnop", "beam_csv", beam, as_csv(base));
  seed("abfghijklm", "beam_log", beam, as_log(base, folder));
  seed("abcdeq", "beam_no_load", beam, as_csv(with(base, Channel::normal_load, 0.0)));

  const std::string force =
      "schema = 1\n[oscillator]\nexcitation = \"force\"\nmass_kg = 1.0\n"
      "stiffness_n_m = { value = 400.0, sigma = 20.0 }\ndamping_ratio = 0.02\n"
      "[normal_load]\nlaw = \"measured\"\n[friction]\nlaw = \"coulomb\"\n"
      "mu = { value = 0.3, sigma = 0.1 }\ntransition_speed_m_s = 0.01\n";
  const protocol::Recording driven =
      with(recorded(config::parse_model(force, "force"), 200, 0.01), Channel::normal_load, 0.5);
  seed("abefilm", "force_csv", force, as_csv(driven));
  seed("abeq", "force_no_load", force, as_csv(with(driven, Channel::normal_load, 0.0)));

  const std::string imposed =
      "schema = 1\n[oscillator]\nexcitation = \"imposed\"\n[friction]\nlaw = \"coulomb\"\nmu = "
      "1.2\n"
      "transition_speed_m_s = 0.001\n[[physics]]\nid = \"asymmetric_friction\"\nasymmetry = 0.1\n";
  seed("abe", "imposed_csv", imposed,
       as_csv(recorded(config::parse_model(imposed, "imposed"), 64, 0.02)));

  protocol::Recording one = base;
  one.frames.resize(1);
  seed("abcdefgijlmq", "one_frame", beam, as_csv(one));
  seed("r", "points", beam, "raw,reference_si\n0,0\n1,2.1\n2,3.9\n3,6.0\n4,8.1\n");
  const fs::path shipped = models.parent_path();
  seed("ns", "rig", content(shipped / "simulated.toml"), "");
  seed("n", "faults", content(shipped / "faults/everything.toml"), "");
  seed("nt", "calibration", content(shipped / "calibrations/beam.toml"), "");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: commands_seeds MODELS FOLDER\n");
    return 2;
  }
  try {
    write_seeds(argv[1], argv[2]);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "commands_seeds: %s\n", error.what());
    return 1;
  }
}
