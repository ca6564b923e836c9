// A rig as its configuration file describes it: which device yields the channels, how they are
// calibrated, how the shaker is driven, and where the data goes.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "physics/frame.h"
#include "physics/model.h"

namespace stickslip::config {

/// [driver.simulated]: a rig of equations behind the driver interface.
struct SimulatedDriver {
  physics::Model truth;  ///< what the rig really does; may hold physics that the rig's model lacks
  std::filesystem::path truth_file;
  std::uint64_t seed = 1;
  bool noise = true;
  double step_s = 1.0e-4;
  double shaker_bandwidth_hz = 60.0;  ///< reconstruction filter and shaker, 4-pole low-pass
  std::array<double, channel_count> resolution{};  ///< quantisation step, SI; 0: none
  bool real_time = true;                           ///< false: time is simulated, as fast as it goes
};

/// [driver.replay]: a recording behind the driver interface.
struct ReplayDriver {
  std::filesystem::path recording;
  double speed = 1.0;  ///< 1: as recorded; 10: ten times as fast; 0: as fast as it goes
};

enum class DriverKind { simulated, replay };

/// SI = (raw - offset) * gain, with raw in the driver's unit.
struct ChannelCalibration {
  double offset = 0.0;
  double gain = 1.0;

  friend bool operator==(const ChannelCalibration&, const ChannelCalibration&) = default;
};

/// One point of an amplitude envelope; amplitudes in between are linear in time.
struct EnvelopePoint {
  double time_s = 0.0;
  double amplitude = 0.0;
};

/// [excitation]: amplitude(t) sin(2 pi carrier_hz t), in metres of base displacement on
/// base-excited rigs and in newtons on force-excited ones. amplitude(t) is
///   amplitude * (1 - depth/2 + depth/2 * cos(2 pi modulation_hz t))   without an envelope, or
///   the envelope table, repeated where `repeat` says so,
/// and always ramps up from zero over ramp_s and down to zero within ramp_s at the stop.
struct Excitation {
  bool enabled = false;
  double carrier_hz = 2.5;
  double amplitude = 0.0;
  double modulation_hz = 0.0;
  double modulation_depth = 0.0;  ///< 0: none, 1: down to zero
  std::vector<EnvelopePoint> envelope;
  bool repeat = true;
  double ramp_s = 0.5;
};

struct Loop {
  double rate_hz = 1000.0;
  int frames_per_block = 10;
  std::optional<double> duration_s;  ///< absent: until told to stop
  bool real_time_scheduling = true;  ///< try SCHED_FIFO and locked memory; refused is reported
};

struct Lcm {
  bool enabled = true;
  std::string url = "udpm://239.255.76.67:7667?ttl=0";
};

struct RecordingOutput {
  bool enabled = false;
  std::filesystem::path file;  ///< LCM event log; its folder must exist
};

struct Observer {
  bool enabled = true;
};

struct Metrics {
  std::filesystem::path file;  ///< empty: none is written; its folder exists
};

/// A whole rig configuration, sound in itself.
struct Rig {
  std::filesystem::path file;
  std::string name;
  std::string text;  ///< the file as read, for the recording's description of itself
  physics::Model model;
  std::filesystem::path model_file;
  std::string model_text;
  DriverKind driver = DriverKind::simulated;
  SimulatedDriver simulated;
  ReplayDriver replay;
  std::array<ChannelCalibration, channel_count> calibration{};
  Excitation excitation;
  Loop loop;
  Lcm lcm;
  RecordingOutput recording;
  Observer observer;
  Metrics metrics;
};

/// Reads a rig configuration and the models that it names (paths relative to the file). Throws
/// InputError with every problem that was found, each with file, line and column.
Rig load_rig(const std::filesystem::path& file);

}  // namespace stickslip::config
