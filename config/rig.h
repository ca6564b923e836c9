// SPDX-License-Identifier: Apache-2.0
// A rig as its configuration file describes it: the device that yields the channels, their
// calibration, the excitation of the shaker, and the outputs.
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
#include "config/names.h"
#include "physics/frame.h"
#include "physics/model.h"
#include "physics/problem.h"

namespace stickslip::config {

/// [driver.simulated]: a simulated rig behind the driver interface.
struct SimulatedDriver {
  physics::Model truth;  ///< simulated; may contain physics that the rig's model lacks
  std::filesystem::path truth_file;
  std::uint64_t seed = 1;
  bool noise = true;
  double step_s = 1.0e-4;
  double shaker_bandwidth_hz = 60.0;  ///< reconstruction filter and shaker, 4-pole low-pass
  std::array<double, channel_count> resolution{};  ///< quantisation step, SI; 0: none
  std::array<bool, channel_count> absent{};        ///< without an instrument
  std::filesystem::path
      relay;              ///< socket of a watchdog relay in place of the amplifier; empty: none
  bool real_time = true;  ///< false: simulated time, as fast as possible
};

/// [driver.replay]: a recording behind the driver interface.
struct ReplayDriver {
  std::filesystem::path recording;
  double speed = 1.0;  ///< relative to the recorded time; 0: as fast as possible
};

enum class DriverKind { simulated, replay, bench };

template <>
inline constexpr auto names<DriverKind> = std::to_array<Name<DriverKind>>({
    {DriverKind::simulated, "simulated"},
    {DriverKind::replay, "replay"},
    {DriverKind::bench, "bench"},
});

/// One point of an amplitude envelope, which is linear in time between its points.
struct EnvelopePoint {
  double time_s = 0.0;
  double amplitude = 0.0;
};

/// Shape of the excitation; docs/excitation.md has the formula of each.
enum class ExcitationKind {
  modulated,  ///< a carrier with modulated amplitude or an envelope table
  by_hand,    ///< a carrier whose amplitude varies as if turned by hand
  sweep,      ///< a carrier of varying frequency
  chirp,      ///< bursts of swept carrier
  multisine,  ///< a sum of sines
  file,       ///< from a recording
};

template <>
inline constexpr auto names<ExcitationKind> = std::to_array<Name<ExcitationKind>>({
    {ExcitationKind::modulated, "modulated"},
    {ExcitationKind::by_hand, "by_hand"},
    {ExcitationKind::sweep, "sweep"},
    {ExcitationKind::chirp, "chirp"},
    {ExcitationKind::multisine, "multisine"},
    {ExcitationKind::file, "file"},
});

/// [excitation.by_hand]: an amplitude that varies between `lowest` and Excitation::amplitude.
struct ByHand {
  double lowest = 0.0;        ///< [m] or [N]
  double bandwidth_hz = 0.2;  ///< of the amplitude
  std::uint64_t seed = 1;
};

enum class SweepScale { linear, logarithmic };

template <>
inline constexpr auto names<SweepScale> = std::to_array<Name<SweepScale>>({
    {SweepScale::linear, "linear"},
    {SweepScale::logarithmic, "logarithmic"},
});

enum class SweepEnd {
  hold,    ///< stays at to_hz
  back,    ///< returns to from_hz in the same time and stays there
  repeat,  ///< sweeps up and down until it is stopped
};

template <>
inline constexpr auto names<SweepEnd> = std::to_array<Name<SweepEnd>>({
    {SweepEnd::hold, "hold"},
    {SweepEnd::back, "back"},
    {SweepEnd::repeat, "repeat"},
});

/// [excitation.sweep]: a sweep, or each burst of a chirp.
struct Sweep {
  double from_hz = 0.0;
  double to_hz = 0.0;
  double duration_s = 0.0;
  SweepScale scale = SweepScale::linear;
  SweepEnd at_end = SweepEnd::hold;  ///< sweeps only
  double pause_s = 0.0;              ///< between bursts; chirps only
  double taper_s = 0.5;              ///< rise time and decay time of a burst; chirps only
};

/// One sine of a multisine: amplitude sin(2 pi frequency_hz t + phase_deg).
struct Line {
  double frequency_hz = 0.0;
  double amplitude = 0.0;  ///< [m] or [N], 0 or more
  double phase_deg = 0.0;
};

/// [excitation.multisine]: `lines`, or `count` lines of equal amplitude from from_hz to to_hz with
/// Schroeder phases, whose sum peaks at Excitation::amplitude.
struct Multisine {
  std::vector<Line> lines;
  int count = 0;
  double from_hz = 0.0;
  double to_hz = 0.0;
};

enum class DriveFileEnd { repeat, ramp_down };

template <>
inline constexpr auto names<DriveFileEnd> = std::to_array<Name<DriveFileEnd>>({
    {DriveFileEnd::repeat, "repeat"},
    {DriveFileEnd::ramp_down, "ramp_down"},
});

/// [excitation.file]: base_displacement_m or drive_force_n over time_s.
struct DriveFile {
  std::filesystem::path path;
  DriveFileEnd at_end = DriveFileEnd::ramp_down;
};

/// [excitation.control]: closed-loop control of the measured amplitude by a gain on the drive.
struct AmplitudeControl {
  bool enabled = false;
  double gain_min = 0.5;
  double gain_max = 2.0;
  double time_constant_s = 1.0;
  double distortion_max = 0.01;  ///< of the measured motion; above it the gain is not raised
};

/// [excitation]: amplitude(t) sin(2 pi carrier_hz t), or the signal of its kind, in metres of base
/// displacement on base-excited rigs and in newtons on force-excited ones. For `modulated`,
/// amplitude(t) is
///   amplitude * (1 - depth/2 + depth/2 * cos(2 pi modulation_hz t))   without an envelope, or
///   the envelope table, repeated if `repeat` is set.
/// Every kind ramps up from zero within ramp_s, and down to zero within ramp_s at the stop.
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
  std::optional<double> amplitude_slew;  ///< [m/s] or [N/s]; absent: to the limit in two seconds
  double carrier_slew_hz_s = 1.0;
  AmplitudeControl control;
};

/// [limits]: bounds of every command to the shaker.
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
  std::optional<double> duration_s;  ///< absent: unlimited
  bool real_time_scheduling =
      true;  ///< request SCHED_FIFO and locked memory; a refusal is reported
  std::optional<double> lateness_limit_s;  ///< absent: one period
  int priority = 50;
  std::optional<int> cpu;  ///< absent: an isolated one, if available
};

/// [control]: the control socket and who may use it.
struct Control {
  std::filesystem::path socket;  ///< empty: in systemd's runtime directory, otherwise none
  std::string group;             ///< empty: the daemon's own
  bool start_at_once = false;
};

/// Permitted range of a channel while the rig is armed or moves, SI.
struct ChannelRange {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
};

/// [safety]: conditions that are faults. Times of 0: no limit.
struct Safety {
  std::optional<double> longest_silence_s;
  double stale_after_s = 0.3;
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
  std::optional<double> rotate_s;   ///< length of a part in rig time; absent: unlimited
  std::optional<double> rotate_mb;  ///< size of a part [10^6 bytes]; absent: unlimited
  double sync_s = 1.0;              ///< largest loss in a power cut; 0: left to the kernel
};

struct Observer {
  bool enabled = true;
  bool model_check = true;
  double days_between_false_alarms = 30.0;  ///< mean, of the model check
};

struct Metrics {
  std::filesystem::path file;  ///< empty: none; its folder exists
};

/// A whole, consistent rig configuration.
struct Rig {
  std::filesystem::path file;
  std::string name;
  std::string text;  ///< the file as read, for the header of recordings
  physics::Model model;
  std::filesystem::path model_file;
  std::string model_text;
  DriverKind driver = DriverKind::simulated;
  SimulatedDriver simulated;
  ReplayDriver replay;
  Bench bench;
  std::optional<FaultScript> faults;       ///< injected into the device, of any kind
  ChannelCalibrations calibration{};       ///< from the calibration file and the rig's own keys
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
  std::vector<Problem> warnings;  ///< of a valid configuration that is likely not intended
};

/// Reads a rig configuration and the models, calibration and fault script that it names (paths
/// relative to the file). Throws InputError with every problem found, each with file, line, column.
Rig load_rig(const std::filesystem::path& file);

}  // namespace stickslip::config
