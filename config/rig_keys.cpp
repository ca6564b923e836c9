// SPDX-License-Identifier: Apache-2.0
// Keys of a rig file, except excitation and bench.
#include <array>

#include "config/key_binding.h"
#include "config/rig_key_parts.h"

namespace stickslip::config {

namespace {

constexpr std::array driver_table = {
    schema_key<Rig>(),
    bound<&Rig::name>(Key{.path = "rig.name",
                          .sentence = "Name of the rig, contained in every recording.",
                          .need = Need::always}),
    bound<&Rig::model_file>(
        Key{.path = "rig.model",
            .sentence = "Model file: the assumed physics of the rig, used by the observer.",
            .need = Need::always}),
    bound<&Rig::driver>(Key{.path = "driver.kind",
                            .sentence = "The device that yields the channels.",
                            .need = Need::always}),
    bound<&Rig::faults, &FaultScript::file>(
        Key{.path = "driver.faults",
            .sentence = "Fault script: faults injected into the device, to test the daemon.",
            .without = "none"}),
    bound<&Rig::simulated, &SimulatedDriver::truth_file>(
        Key{.path = "driver.simulated.truth",
            .sentence = "Model file: the physics that the simulated rig follows.",
            .without = "rig.model"}),
    bound<&Rig::simulated, &SimulatedDriver::seed>(
        Key{.path = "driver.simulated.seed",
            .unit = "1",
            .sentence = "Seed of the sensor noise; runs with the same seed are equal.",
            .low = 0,
            .high = 9.0e15}),
    bound<&Rig::simulated, &SimulatedDriver::noise>(
        Key{.path = "driver.simulated.noise",
            .sentence = "True: the sensors have the noise that the truth declares."}),
    bound<&Rig::simulated, &SimulatedDriver::step_s>(Key{.path = "driver.simulated.step_s",
                                                         .unit = "s",
                                                         .sentence = "Longest integration step.",
                                                         .low = 1.0e-7,
                                                         .high = 0.01}),
    bound<&Rig::simulated, &SimulatedDriver::shaker_bandwidth_hz>(Key{
        .path = "driver.simulated.shaker_bandwidth_hz",
        .unit = "Hz",
        .sentence = "Bandwidth of reconstruction filter and shaker together, a four-pole low-pass.",
        .low = 1,
        .high = 1.0e4}),
    bound<&Rig::simulated, &SimulatedDriver::real_time>(
        Key{.path = "driver.simulated.real_time",
            .sentence = "True: simulated in real time; false: as fast as possible."}),
    bound<&Rig::simulated, &SimulatedDriver::relay>(
        Key{.path = "driver.simulated.relay",
            .sentence =
                "Unix datagram socket of a watchdog relay in place of the amplifier: it receives "
                "the enable state in every cycle, and disables the amplifier without it.",
            .without = "none"}),
    bound<&Rig::simulated, &SimulatedDriver::resolution, by_channel>(
        Key{.path = "driver.simulated.resolution.*",
            .unit = "the channel's",
            .sentence = "Quantisation step of the converter; 0: none.",
            .low = 0}),
    bound<&Rig::simulated, &SimulatedDriver::absent, by_channel>(
        Key{.path = "driver.simulated.absent.*",
            .sentence = "True: the rig has no instrument for this channel."}),
    bound<&Rig::replay, &ReplayDriver::recording>(
        Key{.path = "driver.replay.recording",
            .sentence = "Recording to play: CSV or LCM event log.",
            .need = Need::always,
            .when = "driver.kind=replay"}),
    bound<&Rig::replay, &ReplayDriver::speed>(
        Key{.path = "driver.replay.speed",
            .unit = "1",
            .sentence = "1: as recorded, 10: ten times as fast, 0: as fast as possible.",
            .low = 0,
            .high = 1.0e6}),
};

constexpr std::array loop_table = {
    bound<&Rig::loop, &Loop::rate_hz>(
        Key{.path = "loop.rate_hz",
            .unit = "Hz",
            .sentence = "Rate of the real-time loop and of the frames.",
            .low = 1,
            .high = 2.0e4}),
    bound<&Rig::loop, &Loop::frames_per_block>(Key{.path = "loop.frames_per_block",
                                                   .unit = "1",
                                                   .sentence = "Frames per message.",
                                                   .low = 1,
                                                   .high = 1000}),
    bound<&Rig::loop, &Loop::duration_s>(Key{.path = "loop.duration_s",
                                             .unit = "s",
                                             .sentence = "Time after which the daemon stops.",
                                             .without = "unlimited",
                                             .low = 0,
                                             .above_low = true}),
    bound<&Rig::loop, &Loop::real_time_scheduling>(Key{
        .path = "loop.real_time_scheduling",
        .sentence =
            "True: real-time scheduling and locked memory are requested; a refusal is reported."}),
    bound<&Rig::loop, &Loop::lateness_limit_s>(
        Key{.path = "loop.lateness_limit_s",
            .unit = "s",
            .sentence = "Wake-up lateness from which the frames of a cycle are marked late.",
            .without = "one period",
            .low = 0,
            .high = 1,
            .above_low = true}),
    bound<&Rig::loop, &Loop::priority>(
        Key{.path = "loop.priority",
            .unit = "1",
            .sentence = "Priority of the loop's thread under SCHED_FIFO.",
            .low = 1,
            .high = 98}),
    bound<&Rig::loop, &Loop::cpu>(Key{.path = "loop.cpu",
                                      .unit = "1",
                                      .sentence = "CPU that the loop's thread runs on.",
                                      .without = "an isolated one, if the host has any",
                                      .low = 0,
                                      .high = 4095}),
};

constexpr std::array calibration_table = {
    bound<&Rig::calibration_file>(
        Key{.path = "calibration.file",
            .sentence = "Calibration file: conversion of raw readings to SI, its reference and its "
                        "uncertainty. A channel in it must not have calibration keys here.",
            .without = "none",
            .live = true}),
    bound<&Rig::calibration, by_channel, &ChannelCalibration::offset>(
        Key{.path = "calibration.*.offset",
            .unit = "raw",
            .sentence = "SI = (raw - offset) gain.",
            .live = true}),
    bound<&Rig::calibration, by_channel, &ChannelCalibration::gain>(
        Key{.path = "calibration.*.gain",
            .unit = "SI/raw",
            .sentence = "SI = (raw - offset) gain; not 0.",
            .live = true}),
};

constexpr std::array safety_table = {
    bound<&Rig::control, &Control::socket>(
        Key{.path = "control.socket",
            .sentence = "Socket for `stickslip ctl`; its folder has to exist.",
            .without = "control.sock in systemd's runtime directory; elsewhere none",
            .written = true}),
    bound<&Rig::control, &Control::group>(
        Key{.path = "control.group",
            .sentence = "Group whose members may command the rig, in addition to root and the "
                        "daemon's own user.",
            .without = "the daemon's own group"}),
    bound<&Rig::control, &Control::start_at_once>(Key{
        .path = "control.start_at_once",
        .sentence =
            "True: the daemon clears, arms and starts automatically; for simulated rigs only."}),
    bound<&Rig::safety, &Safety::longest_silence_s>(
        Key{.path = "safety.longest_silence_s",
            .unit = "s",
            .sentence = "Time without a frame from the device, or without acceptance of the drive, "
                        "that is a fault; 0: no limit.",
            .without = "0.1; 0 for a replay",
            .low = 0,
            .high = 60,
            .live = true}),
    bound<&Rig::safety, &Safety::stale_after_s>(
        Key{.path = "safety.stale_after_s",
            .unit = "s",
            .sentence = "Age of a channel's last measurement that is a fault; 0: no limit.",
            .low = 0,
            .high = 60,
            .live = true}),
    bound<&Rig::safety, &Safety::longest_overrun_s>(
        Key{.path = "safety.longest_overrun_s",
            .unit = "s",
            .sentence = "Lateness of a cycle that is a fault; 0: no limit.",
            .without = "0.05; 0 on a simulated rig, whose time waits",
            .low = 0,
            .high = 60,
            .live = true}),
    bound<&Rig::safety, &Safety::dead_man_s>(
        Key{.path = "safety.dead_man_s",
            .unit = "s",
            .sentence = "Time after which a silent client with the dead-man's handle is a fault.",
            .low = 0.05,
            .high = 60,
            .live = true}),
    bound<&Rig::safety, &Safety::not_finite>(
        Key{.path = "safety.not_finite",
            .sentence = "True: a reading that is not finite is a fault.",
            .live = true}),
    bound<&Rig::safety, &Safety::observer_diverged>(
        Key{.path = "safety.observer_diverged",
            .sentence = "True: divergence of the observer is a fault.",
            .live = true}),
    bound<&Rig::safety, &Safety::recorder_failing>(
        Key{.path = "safety.recorder_failing",
            .sentence = "True: loss of frames in the recording is a fault.",
            .live = true}),
    bound<&Rig::safety, &Safety::exit_on_fault>(Key{
        .path = "safety.exit_on_fault",
        .sentence =
            "True: the daemon ends at the first fault instead of waiting until it is cleared."}),
    bound<&Rig::safety, &Safety::range, by_channel, &ChannelRange::low>(
        Key{.path = "safety.range.*.low",
            .unit = "the channel's",
            .sentence = "Lower limit of the calibrated reading, such as that of a strain gauge or "
                        "a stroke; below it is a fault.",
            .without = "none",
            .live = true}),
    bound<&Rig::safety, &Safety::range, by_channel, &ChannelRange::high>(
        Key{.path = "safety.range.*.high",
            .unit = "the channel's",
            .sentence = "Upper limit of the calibrated reading; above it is a fault.",
            .without = "none",
            .live = true}),
};

constexpr std::array output_table = {
    bound<&Rig::lcm, &Lcm::enabled>(Key{
        .path = "lcm.enabled", .sentence = "True: frames, estimates and status are published."}),
    bound<&Rig::lcm, &Lcm::url>(
        Key{.path = "lcm.url", .sentence = "LCM provider; ttl=0 keeps it on this host."}),
    bound<&Rig::recording, &RecordingOutput::enabled>(
        Key{.path = "recording.enabled", .sentence = "True: the daemon records."}),
    bound<&Rig::recording, &RecordingOutput::file>(
        Key{.path = "recording.file",
            .sentence = "LCM event log to write; its folder has to exist. An existing log of that "
                        "name is renamed.",
            .need = Need::always,
            .when = "recording.enabled=true",
            .written = true}),
    bound<&Rig::recording, &RecordingOutput::rotate_s>(
        Key{.path = "recording.rotate_s",
            .unit = "s",
            .sentence = "Rig time after which a new part (run.log, run.001.log, ...) begins.",
            .without = "no limit",
            .low = 1}),
    bound<&Rig::recording, &RecordingOutput::rotate_mb>(
        Key{.path = "recording.rotate_mb",
            .unit = "MB",
            .sentence = "Size of a part [10^6 bytes] from which on a new one begins.",
            .without = "no limit",
            .low = 0.01}),
    bound<&Rig::recording, &RecordingOutput::sync_s>(
        Key{.path = "recording.sync_s",
            .unit = "s",
            .sentence = "Interval of synchronisation to disk, the largest loss in a power cut. 0: "
                        "left to the kernel.",
            .low = 0,
            .high = 3600}),
    bound<&Rig::observer, &Observer::enabled>(Key{
        .path = "observer.enabled", .sentence = "True: friction is estimated while the rig runs."}),
    bound<&Rig::observer, &Observer::model_check>(Key{
        .path = "observer.model_check",
        .sentence = "True: deviations of the rig from its model are reported and explained. Needs "
                    "the observer."}),
    bound<&Rig::observer, &Observer::days_between_false_alarms>(Key{
        .path = "observer.days_between_false_alarms",
        .unit = "days",
        .sentence = "Mean time between false alarms that the limit of the model check is designed "
                    "for.",
        .low = 0.01,
        .high = 10000}),
    bound<&Rig::metrics, &Metrics::file>(
        Key{.path = "metrics.file",
            .sentence = "Status for Prometheus, written once a second; named *.prom, in the folder "
                        "of node_exporter's textfile collector, which has to exist.",
            .without = "none",
            .live = true,
            .written = true}),
};

}  // namespace

template <>
std::span<const Key> keys_of<Rig>() {
  static const std::vector<Key> keys =
      joined<Rig>({driver_table, loop_table, calibration_table, excitation_keys(), safety_table,
                   excitation_kind_keys(), limit_keys(), output_table, bench_keys()});
  return keys;
}

std::span<const Key> rig_keys() { return keys_of<Rig>(); }

}  // namespace stickslip::config
