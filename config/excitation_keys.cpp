// SPDX-License-Identifier: Apache-2.0
// Keys of a rig file on the excitation and its limits.
#include <array>

#include "config/rig_key_parts.h"

namespace stickslip::config {

namespace {

constexpr std::string_view swept = "excitation.kind=sweep|chirp";

constexpr std::array carrier_table = {
    bound<&Rig::excitation, &Excitation::enabled>(
        Key{.path = "excitation.enabled", .sentence = "True: the shaker is driven."}),
    bound<&Rig::excitation, &Excitation::carrier_hz>(
        Key{.path = "excitation.carrier_hz",
            .unit = "Hz",
            .sentence = "Frequency of the drive, amplitude(t) sin(2 pi carrier_hz t); at most a "
                        "quarter of loop.rate_hz. Kinds modulated and by_hand.",
            .low = 0,
            .high = 1000,
            .above_low = true,
            .live = true}),
    bound<&Rig::excitation, &Excitation::amplitude>(
        Key{.path = "excitation.amplitude",
            .unit = "m or N",
            .sentence = "Largest amplitude: m of base displacement, at most 0.1, or N on "
                        "force-excited rigs; not with an envelope.",
            .low = 0,
            .live = true}),
    bound<&Rig::excitation, &Excitation::modulation_hz>(
        Key{.path = "excitation.modulation_hz",
            .unit = "Hz",
            .sentence = "Frequency of amplitude(t) = amplitude (1 - depth/2 + depth/2 cos(2 pi "
                        "modulation_hz t)); not with an envelope.",
            .low = 0,
            .high = 100,
            .live = true}),
    bound<&Rig::excitation, &Excitation::modulation_depth>(
        Key{.path = "excitation.modulation_depth",
            .unit = "1",
            .sentence = "Depth of the modulation; 0: constant amplitude, 1: down to zero; not with "
                        "an envelope.",
            .low = 0,
            .high = 1,
            .live = true}),
    bound<&Rig::excitation, &Excitation::envelope>(
        Key{.path = "excitation.envelope",
            .unit = "s, m or N",
            .sentence = "Amplitude over time: [[0.0, 0.002], [10.0, 0.012], ...], linear in "
                        "between; the first time is 0.",
            .without = "none"}),
    bound<&Rig::excitation, &Excitation::repeat>(
        Key{.path = "excitation.repeat",
            .sentence = "True: repeats the envelope, whose last amplitude must equal its first."}),
    bound<&Rig::excitation, &Excitation::ramp_s>(
        Key{.path = "excitation.ramp_s",
            .unit = "s",
            .sentence = "Time from rest to full amplitude at the start, and back at the stop.",
            .low = 0,
            .high = 60}),
};

constexpr std::array kind_table = {
    bound<&Rig::excitation, &Excitation::kind>(
        Key{.path = "excitation.kind",
            .sentence =
                "Shape of the excitation: a carrier with modulated amplitude or with an amplitude "
                "as if turned by hand, a sweep, bursts of sweeps, a sum of sines, or a file."}),
    bound<&Rig::excitation, &Excitation::by_hand, &ByHand::lowest>(
        Key{.path = "excitation.by_hand.lowest",
            .unit = "m or N",
            .sentence = "Smallest amplitude; the largest is excitation.amplitude.",
            .low = 0}),
    bound<&Rig::excitation, &Excitation::by_hand, &ByHand::bandwidth_hz>(
        Key{.path = "excitation.by_hand.bandwidth_hz",
            .unit = "Hz",
            .sentence = "Bandwidth of the amplitude.",
            .low = 0.001,
            .high = 10}),
    bound<&Rig::excitation, &Excitation::by_hand, &ByHand::seed>(
        Key{.path = "excitation.by_hand.seed",
            .unit = "1",
            .sentence = "Seed of the amplitude; the same seed gives the same amplitude.",
            .low = 0,
            .high = 9.0e15}),
    bound<&Rig::excitation, &Excitation::sweep, &Sweep::from_hz>(
        Key{.path = "excitation.sweep.from_hz",
            .unit = "Hz",
            .sentence = "Initial frequency of a sweep, or of each burst of a chirp.",
            .need = Need::always,
            .when = swept,
            .low = 0,
            .high = 1000,
            .above_low = true}),
    bound<&Rig::excitation, &Excitation::sweep, &Sweep::to_hz>(
        Key{.path = "excitation.sweep.to_hz",
            .unit = "Hz",
            .sentence = "Final frequency; lower than from_hz for a downward sweep.",
            .need = Need::always,
            .when = swept,
            .low = 0,
            .high = 1000,
            .above_low = true}),
    bound<&Rig::excitation, &Excitation::sweep, &Sweep::duration_s>(
        Key{.path = "excitation.sweep.duration_s",
            .unit = "s",
            .sentence = "Duration of the sweep, or of each burst.",
            .need = Need::always,
            .when = swept,
            .low = 0.01,
            .high = 1.0e6}),
    bound<&Rig::excitation, &Excitation::sweep, &Sweep::scale>(
        Key{.path = "excitation.sweep.scale",
            .sentence =
                "Frequency over time: linear, or exponential, with equal ratios in equal times."}),
    bound<&Rig::excitation, &Excitation::sweep, &Sweep::at_end>(
        Key{.path = "excitation.sweep.at_end",
            .sentence = "End of a sweep: hold to_hz, return to from_hz and hold it, or repeat up "
                        "and down. A chirp repeats its burst."}),
    bound<&Rig::excitation, &Excitation::sweep, &Sweep::pause_s>(
        Key{.path = "excitation.sweep.pause_s",
            .unit = "s",
            .sentence = "Pause between the bursts of a chirp.",
            .low = 0,
            .high = 3600}),
    bound<&Rig::excitation, &Excitation::sweep, &Sweep::taper_s>(Key{
        .path = "excitation.sweep.taper_s",
        .unit = "s",
        .sentence = "Rise time and decay time of a burst of a chirp; at most half of duration_s.",
        .low = 0.001,
        .high = 3600}),
    bound<&Rig::excitation, &Excitation::multisine, &Multisine::lines>(Key{
        .path = "excitation.multisine.lines",
        .unit = "Hz, m or N, degrees",
        .sentence =
            "The sines: [[frequency_hz, amplitude, phase_deg], ...]; or count, from_hz and to_hz.",
        .without = "none"}),
    bound<&Rig::excitation, &Excitation::multisine, &Multisine::count>(
        Key{.path = "excitation.multisine.count",
            .unit = "1",
            .sentence = "Number of equally spaced sines of equal amplitude with Schroeder phases; "
                        "their sum peaks at excitation.amplitude.",
            .without = "required without lines",
            .low = 2,
            .high = 200}),
    bound<&Rig::excitation, &Excitation::multisine, &Multisine::from_hz>(
        Key{.path = "excitation.multisine.from_hz",
            .unit = "Hz",
            .sentence = "Lowest frequency.",
            .without = "required without lines",
            .low = 0,
            .high = 1000,
            .above_low = true}),
    bound<&Rig::excitation, &Excitation::multisine, &Multisine::to_hz>(
        Key{.path = "excitation.multisine.to_hz",
            .unit = "Hz",
            .sentence = "Highest frequency.",
            .without = "required without lines",
            .low = 0,
            .high = 1000,
            .above_low = true}),
    bound<&Rig::excitation, &Excitation::file, &DriveFile::path>(
        Key{.path = "excitation.file.path",
            .sentence = "Recording with the drive, base_displacement_m, or drive_force_n on "
                        "force-excited rigs; interpolated by a cubic spline.",
            .need = Need::always,
            .when = "excitation.kind=file"}),
    bound<&Rig::excitation, &Excitation::file, &DriveFile::at_end>(
        Key{.path = "excitation.file.at_end",
            .sentence = "End of the file: repeat, for which it has to end as it begins; or hold "
                        "the last value and ramp down to zero."}),
    bound<&Rig::excitation, &Excitation::amplitude_slew>(
        Key{.path = "excitation.amplitude_slew",
            .unit = "m/s or N/s",
            .sentence = "Rate of change of the amplitude to a value that is set during operation.",
            .without = "to the limit within two seconds",
            .low = 0,
            .above_low = true}),
    bound<&Rig::excitation, &Excitation::carrier_slew_hz_s>(
        Key{.path = "excitation.carrier_slew_hz_s",
            .unit = "Hz/s",
            .sentence = "Rate of change of the carrier to a value that is set during operation.",
            .low = 0,
            .high = 1000,
            .above_low = true}),
    bound<&Rig::excitation, &Excitation::control, &AmplitudeControl::enabled>(
        Key{.path = "excitation.control.enabled",
            .sentence = "True: a gain on the drive controls the measured amplitude; kinds with a "
                        "carrier only."}),
    bound<&Rig::excitation, &Excitation::control, &AmplitudeControl::gain_min>(
        Key{.path = "excitation.control.gain_min",
            .unit = "1",
            .sentence = "Smallest gain.",
            .low = 0.05,
            .high = 1}),
    bound<&Rig::excitation, &Excitation::control, &AmplitudeControl::gain_max>(
        Key{.path = "excitation.control.gain_max",
            .unit = "1",
            .sentence = "Largest gain.",
            .low = 1,
            .high = 20}),
    bound<&Rig::excitation, &Excitation::control, &AmplitudeControl::time_constant_s>(
        Key{.path = "excitation.control.time_constant_s",
            .unit = "s",
            .sentence =
                "Time constant of the amplitude's error; at least three periods of the carrier.",
            .low = 0.05,
            .high = 1000}),
    bound<&Rig::excitation, &Excitation::control, &AmplitudeControl::distortion_max>(
        Key{.path = "excitation.control.distortion_max",
            .unit = "1",
            .sentence = "Second and third harmonic of the measured motion over its fundamental; "
                        "above it the amplifier counts as saturated and the gain is not raised.",
            .low = 0.001,
            .high = 1}),
};

constexpr std::array limit_table = {
    bound<&Rig::limits, &Limits::displacement_m>(
        Key{.path = "limits.displacement_m",
            .unit = "m",
            .sentence = "Largest commanded displacement of the base from its middle.",
            .low = 0,
            .high = 0.5,
            .above_low = true}),
    bound<&Rig::limits, &Limits::velocity_m_s>(
        Key{.path = "limits.velocity_m_s",
            .unit = "m/s",
            .sentence = "Largest commanded velocity of the base.",
            .low = 0,
            .high = 10,
            .above_low = true}),
    bound<&Rig::limits, &Limits::acceleration_m_s2>(
        Key{.path = "limits.acceleration_m_s2",
            .unit = "m/s^2",
            .sentence = "Largest commanded acceleration of the base.",
            .low = 0,
            .high = 1000,
            .above_low = true}),
    bound<&Rig::limits, &Limits::force_n>(
        Key{.path = "limits.force_n",
            .unit = "N",
            .sentence = "Largest commanded force of a force-excited rig.",
            .low = 0,
            .high = 1.0e5,
            .above_low = true}),
    bound<&Rig::limits, &Limits::force_slew_n_s>(
        Key{.path = "limits.force_slew_n_s",
            .unit = "N/s",
            .sentence = "Largest commanded rate of change of that force.",
            .low = 0,
            .high = 1.0e8,
            .above_low = true}),
};

}  // namespace

std::span<const BoundKey<Rig>> excitation_keys() { return carrier_table; }
std::span<const BoundKey<Rig>> excitation_kind_keys() { return kind_table; }
std::span<const BoundKey<Rig>> limit_keys() { return limit_table; }

}  // namespace stickslip::config
