// A rig as its configuration file describes it: which device yields the channels, how they are
// calibrated, how the shaker is driven, and where the data goes.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "config/bench.h"
#include "config/calibration.h"
#include "config/fault_script.h"
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
  std::filesystem::path relay;  ///< socket of a watchdog relay that is the amplifier; empty: none
  bool real_time = true;        ///< false: time is simulated, as fast as it goes
};

/// [driver.replay]: a recording behind the driver interface.
struct ReplayDriver {
  std::filesystem::path recording;
  double speed = 1.0;  ///< 1: as recorded; 10: ten times as fast; 0: as fast as it goes
};

enum class DriverKind { simulated, replay, bench };

/// One point of an amplitude envelope; amplitudes in between are linear in time.
struct EnvelopePoint {
  double time_s = 0.0;
  double amplitude = 0.0;
};

/// What the drive looks like; docs/excitation.md has the formula of each.
enum class ExcitationKind {
  modulated,  ///< a carrier, its amplitude modulated or by an envelope table
  by_hand,    ///< a carrier whose amplitude goes as if turned by hand
  sweep,      ///< a carrier whose frequency moves
  chirp,      ///< bursts of swept carrier
  multisine,  ///< many sines at once
  file,       ///< from a recording
};

/// [excitation.by_hand]: where the amplitude goes, from `lowest` to Excitation::amplitude.
struct ByHand {
  double lowest = 0.0;        ///< [m] or [N]
  double bandwidth_hz = 0.2;  ///< the amplitude has next to nothing above
  std::uint64_t seed = 1;
};

enum class SweepScale { linear, logarithmic };

enum class SweepEnd {
  hold,    ///< stays at to_hz
  back,    ///< comes back to from_hz in the same time and stays there
  repeat,  ///< to and fro until it is stopped
};

/// [excitation.sweep], of a sweep and of each burst of a chirp.
struct Sweep {
  double from_hz = 0.0;
  double to_hz = 0.0;
  double duration_s = 0.0;
  SweepScale scale = SweepScale::linear;
  SweepEnd at_end = SweepEnd::hold;  ///< sweeps only
  double pause_s = 0.0;              ///< between bursts; chirps only
  double taper_s = 0.5;              ///< in which a burst swells, and fades; chirps only
};

/// One sine of a multisine: amplitude sin(2 pi frequency_hz t + phase_deg).
struct Line {
  double frequency_hz = 0.0;
  double amplitude = 0.0;  ///< [m] or [N], 0 or more
  double phase_deg = 0.0;
};

/// [excitation.multisine]: `lines`, or `count` of equal amplitudes from from_hz to to_hz with
/// Schroeder's phases, together as large as Excitation::amplitude.
struct Multisine {
  std::vector<Line> lines;
  int count = 0;
  double from_hz = 0.0;
  double to_hz = 0.0;
};

enum class DriveFileEnd { repeat, ramp_down };

/// [excitation.file]: base_displacement_m or drive_force_n over time_s.
struct DriveFile {
  std::filesystem::path path;
  DriveFileEnd at_end = DriveFileEnd::ramp_down;
};

/// [excitation.control]: a gain on the drive that makes the measured amplitude the asked one.
struct AmplitudeControl {
  bool enabled = false;
  double gain_min = 0.5;
  double gain_max = 2.0;
  double time_constant_s = 1.0;
  double distortion_max = 0.01;  ///< of the measured motion; beyond it the gain is not raised
};

/// [excitation]: amplitude(t) sin(2 pi carrier_hz t), or what its kind says, in metres of base
/// displacement on base-excited rigs and in newtons on force-excited ones. With the kind
/// `modulated`, amplitude(t) is
///   amplitude * (1 - depth/2 + depth/2 * cos(2 pi modulation_hz t))   without an envelope, or
///   the envelope table, repeated where `repeat` says so,
/// and any kind ramps up from zero over ramp_s and down to zero within ramp_s at the stop.
struct Excitation {
  bool enabled = false;
  ExcitationKind kind = ExcitationKind::modulated;
  double carrier_hz = 2.5;
  double amplitude = 0.0;
  double modulation_hz = 0.0;
  double modulation_depth = 0.0;  ///< 0: none, 1: down to zero
  std::vector<EnvelopePoint> envelope;
  bool repeat = true;
  double ramp_s = 0.5;
  ByHand by_hand;
  Sweep sweep;
  Multisine multisine;
  DriveFile file;
  std::optional<double> amplitude_slew;  ///< [m/s] or [N/s]; absent: the limit in two seconds
  double carrier_slew_hz_s = 1.0;
  AmplitudeControl control;
};

/// [limits]: what the shaker is never told to exceed, whatever is asked for.
struct Limits {
  double displacement_m = 0.015;
  double velocity_m_s = 0.5;
  double acceleration_m_s2 = 20.0;
  double force_n = 5.0;  ///< force-excited rigs
  double force_slew_n_s = 500.0;

  friend bool operator==(const Limits&, const Limits&) = default;
};

struct Loop {
  double rate_hz = 1000.0;
  int frames_per_block = 10;
  std::optional<double> duration_s;  ///< absent: until told to stop
  bool real_time_scheduling = true;  ///< try SCHED_FIFO and locked memory; refused is reported
  std::optional<double> lateness_limit_s;  ///< absent: one period
  int priority = 50;
  std::optional<int> cpu;  ///< absent: an isolated one, if there is any
};

/// [control]: who may tell the rig what to do, and where.
struct Control {
  std::filesystem::path socket;  ///< empty: in systemd's runtime directory, or none
  std::string group;             ///< empty: the daemon's own
  bool start_at_once = false;
};

/// Where a channel has to stay while the rig is armed or moves, SI.
struct ChannelRange {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
};

/// [safety]: what is a fault. Times of 0: no limit.
struct Safety {
  std::optional<double> longest_silence_s;
  double stale_after_s = 0.1;
  std::optional<double> longest_overrun_s;
  double dead_man_s = 1.0;
  bool not_finite = true;
  bool observer_diverged = false;
  bool recorder_failing = false;
  bool exit_on_fault = false;
  std::array<ChannelRange, channel_count> range{};
};

struct Lcm {
  bool enabled = true;
  std::string url = "udpm://239.255.76.67:7667?ttl=0";
};

struct RecordingOutput {
  bool enabled = false;
  std::filesystem::path file;       ///< LCM event log; its folder must exist
  std::optional<double> rotate_s;   ///< length of a part in rig time; absent: no limit
  std::optional<double> rotate_mb;  ///< size of a part [10^6 bytes]; absent: no limit
  double sync_s = 1.0;              ///< at most so much is lost in a power cut; 0: up to the kernel
};

struct Observer {
  bool enabled = true;
  bool model_check = true;
  double days_between_false_alarms = 30.0;  ///< of the model check
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
  Bench bench;
  std::optional<FaultScript> faults;       ///< what befalls the device, whichever it is
  ChannelCalibrations calibration{};       ///< of the calibration file and of the rig's own keys
  std::filesystem::path calibration_file;  ///< empty: none
  std::string calibration_text;            ///< the calibration file as read
  Excitation excitation;
  Limits limits;
  Loop loop;
  Control control;
  Safety safety;
  Lcm lcm;
  RecordingOutput recording;
  Observer observer;
  Metrics metrics;
};

/// Reads a rig configuration, the models and the fault script that it names (paths relative to the
/// file). Throws InputError with every problem that was found, each with file, line and column.
Rig load_rig(const std::filesystem::path& file);

}  // namespace stickslip::config
