#include "config/key.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "config/bench_keys.h"
#include "physics/frame.h"

namespace stickslip::config {

namespace {

constexpr double unlimited = std::numeric_limits<double>::infinity();

constexpr std::string_view moving = "oscillator.excitation=base|force";
constexpr std::string_view rubbing = "friction.law=coulomb|state_variable";

constexpr std::array model_table = {
    Key{.path = "schema",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Version of the format of this file.",
        .need = Need::always,
        .low = 1,
        .high = 1},
    Key{.path = "oscillator.excitation",
        .type = Type::choice,
        .sentence = "What drives the rig: its base moves, a force acts on the mass, or the motion "
                    "is imposed and the recorded one; then nothing else stands in [oscillator].",
        .need = Need::always,
        .choices = "base|force|imposed"},
    Key{.path = "oscillator.mass_kg",
        .type = Type::parameter,
        .unit = "kg",
        .sentence = "Mass on the spring.",
        .need = Need::always,
        .when = moving,
        .only_then = true,
        .low = 0,
        .above_low = true},
    Key{.path = "oscillator.natural_frequency_hz",
        .type = Type::parameter,
        .unit = "Hz",
        .sentence = "Natural frequency without friction; or stiffness_n_m.",
        .when = moving,
        .only_then = true,
        .low = 0,
        .above_low = true},
    Key{.path = "oscillator.stiffness_n_m",
        .type = Type::parameter,
        .unit = "N/m",
        .sentence = "Stiffness of the spring, 0 where there is none; or natural_frequency_hz.",
        .when = moving,
        .only_then = true,
        .low = 0},
    Key{.path = "oscillator.damping_ratio",
        .type = Type::parameter,
        .unit = "1",
        .sentence = "Damping ratio of the mass on its spring; or damping_n_s_m.",
        .when = moving,
        .only_then = true,
        .low = 0},
    Key{.path = "oscillator.damping_n_s_m",
        .type = Type::parameter,
        .unit = "N s/m",
        .sentence = "Viscous damping; or damping_ratio.",
        .when = moving,
        .only_then = true,
        .low = 0},
    Key{.path = "oscillator.two_well.linear_n_m",
        .type = Type::parameter,
        .unit = "N/m",
        .sentence = "Magnets: the restoring force is -linear_n_m x + cubic_n_m3 x^3, not k x.",
        .need = Need::in_table,
        .when = moving,
        .only_then = true,
        .low = 0,
        .above_low = true},
    Key{.path = "oscillator.two_well.cubic_n_m3",
        .type = Type::parameter,
        .unit = "N/m^3",
        .sentence = "Magnets: cubic part of the restoring force.",
        .need = Need::in_table,
        .when = moving,
        .only_then = true,
        .low = 0,
        .above_low = true},
    Key{.path = "normal_load.law",
        .type = Type::choice,
        .sentence = "How the normal load comes about: N = load_n, N = max(0, load_n (1 + "
                    "slope_per_m x)), or the recorded channel. Without [normal_load]: N = 1 N.",
        .need = Need::in_table,
        .choices = "constant|wedge|measured"},
    Key{.path = "normal_load.load_n",
        .type = Type::parameter,
        .unit = "N",
        .sentence = "Normal load at x = 0, summed over both pads.",
        .need = Need::in_table,
        .when = "normal_load.law=constant|wedge",
        .only_then = true,
        .low = 0},
    Key{.path = "normal_load.slope_per_m",
        .type = Type::parameter,
        .unit = "1/m",
        .sentence = "Relative change of the normal load with deflection.",
        .need = Need::in_table,
        .when = "normal_load.law=wedge",
        .only_then = true},
    Key{.path = "friction.law",
        .type = Type::choice,
        .sentence = "theta of f = mu N theta: no friction, theta = g(v), or theta' = -rate_per_s "
                    "(theta - g(v)). Without [friction]: none.",
        .need = Need::in_table,
        .fallback = "none",
        .choices = "none|coulomb|state_variable"},
    Key{.path = "friction.mu",
        .type = Type::parameter,
        .unit = "1",
        .sentence = "Coefficient of friction; in N where no normal load is declared.",
        .need = Need::in_table,
        .when = rubbing,
        .only_then = true,
        .low = 0},
    Key{.path = "friction.transition_speed_m_s",
        .type = Type::parameter,
        .unit = "m/s",
        .sentence = "g(v) = tanh(v / transition_speed_m_s); 0: sign(v), and any value in [-1, 1] "
                    "while v = 0.",
        .need = Need::in_table,
        .when = rubbing,
        .only_then = true,
        .low = 0},
    Key{.path = "friction.rate_per_s",
        .type = Type::parameter,
        .unit = "1/s",
        .sentence = "Rate gamma at which theta follows g(v).",
        .need = Need::in_table,
        .when = "friction.law=state_variable",
        .only_then = true,
        .low = 0,
        .above_low = true},
    Key{.path = "load_cell.mass_kg",
        .type = Type::parameter,
        .unit = "kg",
        .sentence = "Mass that rides on the load cell. Without [load_cell]: rigid attachment.",
        .need = Need::in_table,
        .low = 0,
        .above_low = true},
    Key{.path = "load_cell.natural_frequency_hz",
        .type = Type::parameter,
        .unit = "Hz",
        .sentence = "Natural frequency of the load cell.",
        .need = Need::in_table,
        .low = 0,
        .above_low = true},
    Key{.path = "load_cell.damping_ratio",
        .type = Type::parameter,
        .unit = "1",
        .sentence = "Damping ratio of the load cell.",
        .need = Need::in_table,
        .low = 0},
    Key{.path = "load_cell.dynamics",
        .type = Type::choice,
        .sentence = "Eq. (1) of the paper taken as exact, or all of the load cell's equation.",
        .need = Need::in_table,
        .choices = "quasi_static|resonant"},
    Key{.path = "normal_load_bridge.mismatch",
        .type = Type::number,
        .unit = "1",
        .sentence = "Both pads' gauges sit in one bridge, which reads only v1 + v2: relative "
                    "difference of their calibrations, (c1 - c2) / (c1 + c2). Without "
                    "[normal_load_bridge]: the reading is N.",
        .need = Need::in_table,
        .low = -1,
        .above_low = true},
    Key{.path = "normal_load_bridge.share",
        .type = Type::number,
        .unit = "1",
        .sentence = "Share of the normal load on the first pad, at displacement 0.",
        .fallback = "0.5",
        .low = 0,
        .high = 1},
    Key{.path = "normal_load_bridge.share_slope_per_m",
        .type = Type::number,
        .unit = "1/m",
        .sentence = "Change of that share with displacement; it stays within 0 to 1.",
        .fallback = "0"},
    Key{.path = "sensors.*.noise_std",
        .type = Type::number,
        .unit = "the channel's",
        .sentence = "Standard deviation of the reading's white noise.",
        .fallback = "unknown: estimated",
        .low = 0,
        .above_low = true},
    Key{.path = "sensors.*.filters",
        .type = Type::filters,
        .sentence = "Analogue filters in the order of the signal; those of the velocity follow "
                    "those of the displacement.",
        .fallback = "none"},
    Key{.path = "physics",
        .type = Type::terms,
        .sentence = "One [[physics]] table for each term that a diagnosis added.",
        .fallback = "none"},
};

constexpr std::array filter_table = {
    Key{.path = "kind",
        .type = Type::choice,
        .sentence = "Shape of the filter.",
        .need = Need::always,
        .choices = "butterworth_lowpass|first_order_lowpass"},
    Key{.path = "order",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Number of poles.",
        .need = Need::always,
        .when = "kind=butterworth_lowpass",
        .only_then = true,
        .low = 1,
        .high = 8},
    Key{.path = "cutoff_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Frequency at which half the power is left.",
        .need = Need::always,
        .low = 0,
        .above_low = true},
};

constexpr std::array term_table = {
    Key{.path = "id",
        .type = Type::text,
        .sentence = "Effect of the catalogue; its parameters are the further keys, each a number "
                    "or { value, sigma }.",
        .need = Need::always},
    Key{.path = "channel",
        .type = Type::choice,
        .sentence = "The channel that is read wrongly; effects of the relation sensor only.",
        .choices =
            "displacement|velocity|friction_force|normal_load|base_displacement|drive_force"},
    Key{.path = "from",
        .type = Type::choice,
        .sentence = "The channel that leaks into it; crosstalk only.",
        .choices =
            "displacement|velocity|friction_force|normal_load|base_displacement|drive_force"},
};

constexpr std::string_view swept = "excitation.kind=sweep|chirp";

constexpr std::array rig_table_itself = {
    Key{.path = "schema",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Version of the format of this file.",
        .need = Need::always,
        .low = 1,
        .high = 1},
    Key{.path = "rig.name",
        .type = Type::text,
        .sentence = "Name of the rig; stands in every recording.",
        .need = Need::always},
    Key{.path = "rig.model",
        .type = Type::file,
        .sentence = "Model file: the physics that the rig's owner believes in. The observer "
                    "works with it.",
        .need = Need::always},
    Key{.path = "driver.kind",
        .type = Type::choice,
        .sentence = "The device that yields the channels.",
        .need = Need::always,
        .choices = "simulated|replay|bench"},
    Key{.path = "driver.faults",
        .type = Type::file,
        .sentence = "Fault script: what befalls the device, to see what the daemon makes of it.",
        .fallback = "none"},
    Key{.path = "driver.simulated.truth",
        .type = Type::file,
        .sentence = "Model file: what the simulated rig really does.",
        .fallback = "rig.model"},
    Key{.path = "driver.simulated.seed",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Seed of the sensor noise; the same seed, the same run.",
        .fallback = "1",
        .low = 0,
        .high = 9.0e15},
    Key{.path = "driver.simulated.noise",
        .type = Type::boolean,
        .sentence = "Whether the sensors have the noise that the truth declares.",
        .fallback = "true"},
    Key{.path = "driver.simulated.step_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "Longest integration step.",
        .fallback = "0.0001",
        .low = 1.0e-7,
        .high = 0.01},
    Key{.path = "driver.simulated.shaker_bandwidth_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Reconstruction filter and shaker together: a four-pole low-pass.",
        .fallback = "60",
        .low = 1,
        .high = 1.0e4},
    Key{.path = "driver.simulated.real_time",
        .type = Type::boolean,
        .sentence = "Whether a second of the rig takes a second; false: as fast as it goes.",
        .fallback = "true"},
    Key{.path = "driver.simulated.relay",
        .type = Type::file,
        .sentence = "Unix datagram socket of a watchdog relay that stands for the amplifier: it is "
                    "told in every cycle whether it may be on, and lets go when it hears nothing.",
        .fallback = "none"},
    Key{.path = "driver.simulated.resolution.*",
        .type = Type::number,
        .unit = "the channel's",
        .sentence = "Step of the converter; 0: none.",
        .fallback = "0",
        .low = 0},
    Key{.path = "driver.replay.recording",
        .type = Type::file,
        .sentence = "Recording to play: CSV or LCM event log.",
        .need = Need::always,
        .when = "driver.kind=replay"},
    Key{.path = "driver.replay.speed",
        .type = Type::number,
        .unit = "1",
        .sentence = "1: as recorded, 10: ten times as fast, 0: as fast as it goes.",
        .fallback = "1",
        .low = 0,
        .high = 1.0e6},
    Key{.path = "loop.rate_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Cycles of the real-time loop, and frames, a second.",
        .fallback = "1000",
        .low = 1,
        .high = 2.0e4},
    Key{.path = "loop.frames_per_block",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Frames in one message.",
        .fallback = "10",
        .low = 1,
        .high = 1000},
    Key{.path = "loop.duration_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "Time after which the daemon stops by itself.",
        .fallback = "until told to stop",
        .low = 0,
        .above_low = true},
    Key{.path = "loop.real_time_scheduling",
        .type = Type::boolean,
        .sentence = "Whether real-time scheduling and locked memory are asked for; what is refused "
                    "is said.",
        .fallback = "true"},
    Key{.path = "loop.lateness_limit_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "How late a wake-up may be before the frames of that cycle say so.",
        .fallback = "one period",
        .low = 0,
        .high = 1,
        .above_low = true},
    Key{.path = "loop.priority",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Priority of the loop's thread under SCHED_FIFO.",
        .fallback = "50",
        .low = 1,
        .high = 98},
    Key{.path = "loop.cpu",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Processor that the loop's thread stays on.",
        .fallback = "an isolated one, where the host has any",
        .low = 0,
        .high = 4095},
    Key{.path = "calibration.file",
        .type = Type::file,
        .sentence =
            "Calibration file: how raw readings become SI, against what that was found, and "
            "how sure it is. A channel that it names may not stand here as well.",
        .fallback = "none",
        .live = true},
    Key{.path = "calibration.*.offset",
        .type = Type::number,
        .unit = "raw",
        .sentence = "SI = (raw - offset) gain.",
        .fallback = "0",
        .live = true},
    Key{.path = "calibration.*.gain",
        .type = Type::number,
        .unit = "SI/raw",
        .sentence = "SI = (raw - offset) gain; not 0.",
        .fallback = "1",
        .live = true},
    Key{.path = "excitation.enabled",
        .type = Type::boolean,
        .sentence = "Whether the shaker is driven.",
        .fallback = "false"},
    Key{.path = "excitation.carrier_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Frequency of the drive, amplitude(t) sin(2 pi carrier_hz t); at most a "
                    "quarter of loop.rate_hz. Kinds modulated and by_hand.",
        .fallback = "2.5",
        .low = 0,
        .high = 1000,
        .above_low = true,
        .live = true},
    Key{.path = "excitation.amplitude",
        .type = Type::number,
        .unit = "m or N",
        .sentence = "Largest amplitude: m of base displacement, at most 0.1, or N where a force "
                    "drives the rig; not with an envelope.",
        .fallback = "0",
        .low = 0,
        .live = true},
    Key{.path = "excitation.modulation_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Frequency of amplitude(t) = amplitude (1 - depth/2 + depth/2 cos(2 pi "
                    "modulation_hz t)); not with an envelope.",
        .fallback = "0",
        .low = 0,
        .high = 100,
        .live = true},
    Key{.path = "excitation.modulation_depth",
        .type = Type::number,
        .unit = "1",
        .sentence = "depth in it; 0: the amplitude is constant, 1: it goes down to zero; not with "
                    "an envelope.",
        .fallback = "0",
        .low = 0,
        .high = 1,
        .live = true},
    Key{.path = "excitation.envelope",
        .type = Type::envelope,
        .unit = "s, m or N",
        .sentence = "The amplitude over time: [[0.0, 0.002], [10.0, 0.012], ...], linear in "
                    "between, the first time 0.",
        .fallback = "none"},
    Key{.path = "excitation.repeat",
        .type = Type::boolean,
        .sentence = "Whether the envelope begins anew at its end; then it has to end as it begins.",
        .fallback = "true"},
    Key{.path = "excitation.ramp_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "Time from rest to full amplitude at the start, and back at the stop.",
        .fallback = "0.5",
        .low = 0,
        .high = 60},
    Key{.path = "control.socket",
        .type = Type::file,
        .sentence = "Where `stickslip ctl` meets the daemon; its folder has to exist.",
        .fallback = "control.sock in systemd's runtime directory; elsewhere none"},
    Key{.path = "control.group",
        .type = Type::text,
        .sentence = "Members of this group may command the rig, besides root and the daemon's own "
                    "user.",
        .fallback = "the daemon's own group"},
    Key{.path = "control.start_at_once",
        .type = Type::boolean,
        .sentence =
            "Whether the daemon clears, arms and starts by itself; only for simulated rigs: "
            "on others a person does it.",
        .fallback = "false"},
    Key{.path = "safety.longest_silence_s",
        .type = Type::number,
        .unit = "s",
        .sentence =
            "Time for which the device may yield no frame, or take no drive, before that is "
            "a fault; 0: any.",
        .fallback = "0.1; 0 for a replay",
        .low = 0,
        .high = 60,
        .live = true},
    Key{.path = "safety.stale_after_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "Time for which a channel may not be measured before that is a fault; 0: any.",
        .fallback = "0.1",
        .low = 0,
        .high = 60,
        .live = true},
    Key{.path = "safety.longest_overrun_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "How late a cycle may come before that is a fault; 0: any.",
        .fallback = "0.05; 0 on a simulated rig, whose time waits",
        .low = 0,
        .high = 60,
        .live = true},
    Key{.path = "safety.dead_man_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "Time for which a client that holds the dead-man's handle may be silent.",
        .fallback = "1",
        .low = 0.05,
        .high = 60,
        .live = true},
    Key{.path = "safety.not_finite",
        .type = Type::boolean,
        .sentence = "Whether a reading that is no finite number is a fault.",
        .fallback = "true",
        .live = true},
    Key{.path = "safety.observer_diverged",
        .type = Type::boolean,
        .sentence = "Whether it is a fault that the observer diverges.",
        .fallback = "false",
        .live = true},
    Key{.path = "safety.recorder_failing",
        .type = Type::boolean,
        .sentence = "Whether it is a fault that the recording loses frames.",
        .fallback = "false",
        .live = true},
    Key{.path = "safety.exit_on_fault",
        .type = Type::boolean,
        .sentence = "Whether the daemon ends with the first fault, and does not wait for a person "
                    "to clear it.",
        .fallback = "false"},
    Key{.path = "safety.range.*.low",
        .type = Type::number,
        .unit = "the channel's",
        .sentence = "A calibrated reading below this is a fault: the limit of a strain gauge or of "
                    "a stroke.",
        .fallback = "none",
        .live = true},
    Key{.path = "safety.range.*.high",
        .type = Type::number,
        .unit = "the channel's",
        .sentence = "A calibrated reading above this is a fault.",
        .fallback = "none",
        .live = true},
    Key{.path = "excitation.kind",
        .type = Type::choice,
        .sentence = "What the drive looks like: a carrier with a modulated amplitude or one that "
                    "goes as if turned by hand, a sweep, bursts of sweeps, many sines at once, or "
                    "a file.",
        .fallback = "modulated",
        .choices = "modulated|by_hand|sweep|chirp|multisine|file"},
    Key{.path = "excitation.by_hand.lowest",
        .type = Type::number,
        .unit = "m or N",
        .sentence = "Amplitude down to which the hand turns; up to excitation.amplitude.",
        .fallback = "0",
        .low = 0},
    Key{.path = "excitation.by_hand.bandwidth_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "How fast the hand is: the amplitude has next to nothing above.",
        .fallback = "0.2",
        .low = 0.001,
        .high = 10},
    Key{.path = "excitation.by_hand.seed",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Seed of the hand's movements; the same seed, the same movements.",
        .fallback = "1",
        .low = 0,
        .high = 9.0e15},
    Key{.path = "excitation.sweep.from_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Frequency at which a sweep, or each burst of a chirp, begins.",
        .need = Need::always,
        .when = swept,
        .low = 0,
        .high = 1000,
        .above_low = true},
    Key{.path = "excitation.sweep.to_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Frequency at which it ends; lower than from_hz for a sweep down.",
        .need = Need::always,
        .when = swept,
        .low = 0,
        .high = 1000,
        .above_low = true},
    Key{.path = "excitation.sweep.duration_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "Time from the one to the other.",
        .need = Need::always,
        .when = swept,
        .low = 0.01,
        .high = 1.0e6},
    Key{.path = "excitation.sweep.scale",
        .type = Type::choice,
        .sentence = "Whether equal times are equal differences or equal ratios of frequency.",
        .fallback = "linear",
        .choices = "linear|logarithmic"},
    Key{.path = "excitation.sweep.at_end",
        .type = Type::choice,
        .sentence = "What a sweep does at to_hz: stays there, goes back to from_hz and stays "
                    "there, or goes to and fro. A chirp begins anew.",
        .fallback = "hold",
        .choices = "hold|back|repeat"},
    Key{.path = "excitation.sweep.pause_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "Rest between the bursts of a chirp.",
        .fallback = "0",
        .low = 0,
        .high = 3600},
    Key{.path = "excitation.sweep.taper_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "Time in which a burst of a chirp swells, and in which it fades; at most half "
                    "of duration_s.",
        .fallback = "0.5",
        .low = 0.001,
        .high = 3600},
    Key{.path = "excitation.multisine.lines",
        .type = Type::lines,
        .unit = "Hz, m or N, degrees",
        .sentence = "The sines: [[frequency_hz, amplitude, phase_deg], ...]; or count, from_hz "
                    "and to_hz.",
        .fallback = "none"},
    Key{.path = "excitation.multisine.count",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Number of sines of equal amplitude and equal spacing, with Schroeder's "
                    "phases; their sum reaches excitation.amplitude.",
        .fallback = "needed without lines",
        .low = 2,
        .high = 200},
    Key{.path = "excitation.multisine.from_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Lowest of them.",
        .fallback = "needed without lines",
        .low = 0,
        .high = 1000,
        .above_low = true},
    Key{.path = "excitation.multisine.to_hz",
        .type = Type::number,
        .unit = "Hz",
        .sentence = "Highest of them.",
        .fallback = "needed without lines",
        .low = 0,
        .high = 1000,
        .above_low = true},
    Key{.path = "excitation.file.path",
        .type = Type::file,
        .sentence = "Recording whose base_displacement_m, or drive_force_n where a force drives "
                    "the rig, is the drive; a cubic spline between its samples.",
        .need = Need::always,
        .when = "excitation.kind=file"},
    Key{.path = "excitation.file.at_end",
        .type = Type::choice,
        .sentence = "What happens at the end of the file: it begins anew, and then has to end as "
                    "it begins; or its last value is held and ramped down to zero.",
        .fallback = "ramp_down",
        .choices = "repeat|ramp_down"},
    Key{.path = "excitation.amplitude_slew",
        .type = Type::number,
        .unit = "m/s or N/s",
        .sentence = "How fast the amplitude moves to a value that is set while the rig runs.",
        .fallback = "the limit within two seconds",
        .low = 0,
        .above_low = true},
    Key{.path = "excitation.carrier_slew_hz_s",
        .type = Type::number,
        .unit = "Hz/s",
        .sentence = "How fast the carrier moves to a value that is set while the rig runs.",
        .fallback = "1",
        .low = 0,
        .high = 1000,
        .above_low = true},
    Key{.path = "excitation.control.enabled",
        .type = Type::boolean,
        .sentence = "Whether a gain on the drive makes the measured amplitude the one that is "
                    "asked for; kinds with a carrier only.",
        .fallback = "false"},
    Key{.path = "excitation.control.gain_min",
        .type = Type::number,
        .unit = "1",
        .sentence = "Smallest gain.",
        .fallback = "0.5",
        .low = 0.05,
        .high = 1},
    Key{.path = "excitation.control.gain_max",
        .type = Type::number,
        .unit = "1",
        .sentence = "Largest gain.",
        .fallback = "2",
        .low = 1,
        .high = 20},
    Key{.path = "excitation.control.time_constant_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "Time in which an error of the amplitude falls to a third; not less than "
                    "three periods of the carrier, whatever stands here.",
        .fallback = "1",
        .low = 0.05,
        .high = 1000},
    Key{.path = "excitation.control.distortion_max",
        .type = Type::number,
        .unit = "1",
        .sentence = "Second and third harmonic of the measured motion over its fundamental; "
                    "beyond it the amplifier counts as saturated and the gain is not raised.",
        .fallback = "0.01",
        .low = 0.001,
        .high = 1},
    Key{.path = "limits.displacement_m",
        .type = Type::number,
        .unit = "m",
        .sentence = "Farthest from its middle that the base is ever told to be.",
        .fallback = "0.015",
        .low = 0,
        .high = 0.5,
        .above_low = true},
    Key{.path = "limits.velocity_m_s",
        .type = Type::number,
        .unit = "m/s",
        .sentence = "Fastest that the base is ever told to move.",
        .fallback = "0.5",
        .low = 0,
        .high = 10,
        .above_low = true},
    Key{.path = "limits.acceleration_m_s2",
        .type = Type::number,
        .unit = "m/s^2",
        .sentence = "Largest acceleration that the base is ever told.",
        .fallback = "20",
        .low = 0,
        .high = 1000,
        .above_low = true},
    Key{.path = "limits.force_n",
        .type = Type::number,
        .unit = "N",
        .sentence = "Largest force that a force-excited rig is ever told.",
        .fallback = "5",
        .low = 0,
        .high = 1.0e5,
        .above_low = true},
    Key{.path = "limits.force_slew_n_s",
        .type = Type::number,
        .unit = "N/s",
        .sentence = "Fastest that such a force is ever told to change.",
        .fallback = "500",
        .low = 0,
        .high = 1.0e8,
        .above_low = true},
    Key{.path = "lcm.enabled",
        .type = Type::boolean,
        .sentence = "Whether frames, estimates and status are published.",
        .fallback = "true"},
    Key{.path = "lcm.url",
        .type = Type::text,
        .sentence = "LCM provider; ttl=0 keeps it on this host.",
        .fallback = "udpm://239.255.76.67:7667?ttl=0"},
    Key{.path = "recording.enabled",
        .type = Type::boolean,
        .sentence = "Whether the daemon records.",
        .fallback = "false"},
    Key{.path = "recording.file",
        .type = Type::file,
        .sentence = "LCM event log to write; its folder has to exist. A log of that name is kept "
                    "under another one.",
        .need = Need::always,
        .when = "recording.enabled=true"},
    Key{.path = "recording.rotate_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "A new part (run.log, run.001.log, ...) begins after so much rig time.",
        .fallback = "no limit",
        .low = 1},
    Key{.path = "recording.rotate_mb",
        .type = Type::number,
        .unit = "MB",
        .sentence = "A new part begins when one holds so many 10^6 bytes.",
        .fallback = "no limit",
        .low = 0.01},
    Key{.path = "recording.sync_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "How often the disk is made to have what was recorded: at most so much is lost "
                    "in a power cut. 0: left to the kernel.",
        .fallback = "1.0",
        .low = 0,
        .high = 3600},
    Key{.path = "observer.enabled",
        .type = Type::boolean,
        .sentence = "Whether friction is estimated while the rig runs.",
        .fallback = "true"},
    Key{.path = "observer.model_check",
        .type = Type::boolean,
        .sentence =
            "Whether a warning is given when the rig no longer follows its model. Needs the "
            "observer.",
        .fallback = "true"},
    Key{.path = "observer.days_between_false_alarms",
        .type = Type::number,
        .unit = "days",
        .sentence = "Mean time between false warnings that the model check's thresholds are made "
                    "for.",
        .fallback = "30.0",
        .low = 0.01,
        .high = 10000},
    Key{.path = "metrics.file",
        .type = Type::file,
        .sentence = "Status for Prometheus, written once a second; named *.prom, in the folder "
                    "that node_exporter's textfile collector reads, which has to exist.",
        .fallback = "none is written",
        .live = true},
};

/// The keys of any rig, and those of a bench of real devices.
constexpr auto rig_table = [] {
  std::array<Key, rig_table_itself.size() + bench_table.size()> keys{};
  std::copy(rig_table_itself.begin(), rig_table_itself.end(), keys.begin());
  std::copy(bench_table.begin(), bench_table.end(), keys.begin() + rig_table_itself.size());
  return keys;
}();

constexpr std::string_view any_channel =
    "displacement|velocity|friction_force|normal_load|base_displacement|drive_force";

constexpr std::array fault_script_table = {
    Key{.path = "schema",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Version of the format of this file.",
        .need = Need::always,
        .low = 1,
        .high = 1},
    Key{.path = "seed",
        .type = Type::integer,
        .unit = "1",
        .sentence =
            "Seed of all that is left to chance; the same seed and frames, the same faults.",
        .fallback = "1",
        .low = 0,
        .high = 9.0e15},
    Key{.path = "fault",
        .type = Type::faults,
        .sentence = "One [[fault]] table for each fault, 256 at most.",
        .fallback = "none"},
};

constexpr double longest_script_s = 1.0e7;

constexpr std::array fault_table = {
    Key{.path = "kind",
        .type = Type::choice,
        .sentence = "What befalls the device.",
        .need = Need::always,
        .choices = "noise|stick|drift|delay|drop|duplicate|reorder|saturate|nan|clock_jump|unplug|"
                   "stall|emergency_stop|amplifier_fault|read_error|write_error"},
    Key{.path = "channel",
        .type = Type::choice,
        .sentence = "The channel that it befalls; noise, stick, drift, delay, saturate, nan only.",
        .fallback = "all of the device's",
        .when = "kind=noise|stick|drift|delay|saturate|nan",
        .only_then = true,
        .choices = any_channel},
    Key{.path = "at_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "When it begins, from the first frame on; or between_s.",
        .low = 0,
        .high = longest_script_s},
    Key{.path = "between_s",
        .type = Type::span,
        .unit = "s",
        .sentence = "It begins at a moment drawn between these two, at each repetition anew; or "
                    "at_s.",
        .low = 0,
        .high = longest_script_s},
    Key{.path = "duration_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "How long it lasts; a stall lasts its amount.",
        .fallback = "to the end of the run",
        .when = "kind=noise|stick|drift|delay|drop|duplicate|reorder|saturate|nan|clock_jump|"
                "unplug|emergency_stop|amplifier_fault|read_error|write_error",
        .only_then = true,
        .low = 0,
        .high = longest_script_s,
        .above_low = true},
    Key{.path = "every_s",
        .type = Type::number,
        .unit = "s",
        .sentence = "From one beginning to the next; needs a duration that fits in.",
        .fallback = "once",
        .low = 1.0e-6,
        .high = longest_script_s},
    Key{.path = "probability",
        .type = Type::number,
        .unit = "1",
        .sentence = "For each frame (read_error: each read, write_error: each write) while it "
                    "lasts; noise, nan, drop, duplicate, reorder, read_error, write_error only.",
        .fallback = "1",
        .when = "kind=noise|nan|drop|duplicate|reorder|read_error|write_error",
        .only_then = true,
        .low = 0,
        .high = 1,
        .above_low = true},
    Key{.path = "amount",
        .type = Type::number,
        .unit = "its kind's",
        .sentence = "How much, by kind, as below.",
        .need = Need::always,
        .when = "kind=noise|drift|delay|saturate|clock_jump|stall",
        .only_then = true},
    Key{.path = "reported",
        .type = Type::boolean,
        .sentence = "delay only: whether the frame tells the channel's age.",
        .fallback = "false",
        .when = "kind=delay",
        .only_then = true},
    Key{.path = "stall_blocking",
        .type = Type::boolean,
        .sentence = "stall only: whether one read takes all that time, and not many yield nothing.",
        .fallback = "false",
        .when = "kind=stall",
        .only_then = true},
};

constexpr std::array fault_amount_table = {
    Key{.path = "noise",
        .unit = "the channel's",
        .sentence = "Standard deviation of the white noise that is added.",
        .need = Need::always,
        .low = 0,
        .above_low = true},
    Key{.path = "drift",
        .unit = "the channel's, per s",
        .sentence = "Rate at which the reading walks away, from 0 at the beginning on; not 0.",
        .need = Need::always},
    Key{.path = "delay",
        .unit = "s",
        .sentence = "How old the reading is.",
        .need = Need::always,
        .low = 0,
        .high = 10,
        .above_low = true},
    Key{.path = "saturate",
        .unit = "the channel's",
        .sentence = "Largest magnitude of the reading.",
        .need = Need::always,
        .low = 0,
        .above_low = true},
    Key{.path = "clock_jump",
        .unit = "s",
        .sentence = "By how much the device's clock is ahead, negative: behind; not 0.",
        .need = Need::always,
        .low = -1.0e6,
        .high = 1.0e6},
    Key{.path = "stall",
        .unit = "s",
        .sentence = "How long no data comes.",
        .need = Need::always,
        .low = 0,
        .high = 3600,
        .above_low = true},
};

constexpr std::array calibration_file_table = {
    Key{.path = "schema",
        .type = Type::integer,
        .unit = "1",
        .sentence = "Version of the format of this file.",
        .need = Need::always,
        .low = 1,
        .high = 1},
    Key{.path = "channel.*",
        .type = Type::calibration,
        .sentence = "The calibration that holds for the channel.",
        .fallback = "raw is SI"},
    Key{.path = "history",
        .type = Type::history,
        .sentence = "One [[history]] table for each calibration that held before, of each channel "
                    "the newest first.",
        .fallback = "none"},
};

constexpr std::array calibration_table = {
    Key{.path = "offset",
        .type = Type::number,
        .unit = "raw",
        .sentence = "SI = (raw - offset) gain, less what leaks in from other channels.",
        .need = Need::always},
    Key{.path = "gain",
        .type = Type::number,
        .unit = "SI/raw",
        .sentence = "SI = (raw - offset) gain; not 0.",
        .need = Need::always},
    Key{.path = "covariance",
        .type = Type::covariance,
        .unit = "raw^2, SI, (SI/raw)^2",
        .sentence = "Variance of the offset, covariance of both, variance of the gain.",
        .fallback = "not known"},
    Key{.path = "residual_std",
        .type = Type::number,
        .unit = "SI",
        .sentence = "Standard deviation of the points about the line.",
        .fallback = "0",
        .low = 0},
    Key{.path = "crosstalk",
        .type = Type::leaks,
        .unit = "SI/SI",
        .sentence = "How much of other channels' SI values leaks into this reading; it is taken "
                    "off.",
        .fallback = "none"},
    Key{.path = "valid_range",
        .type = Type::range,
        .unit = "SI",
        .sentence = "Where the calibration was looked at; values outside are marked, and kept.",
        .fallback = "anywhere"},
    Key{.path = "raw_unit",
        .type = Type::text,
        .sentence = "Unit of the readings, as the driver names it.",
        .fallback = "not told"},
    Key{.path = "date", .type = Type::date, .sentence = "When it was done.", .need = Need::always},
    Key{.path = "reference",
        .type = Type::text,
        .sentence = "Against what: \"weights set 12, class M1\".",
        .need = Need::always},
    Key{.path = "by", .type = Type::text, .sentence = "Who did it.", .fallback = "not told"},
    Key{.path = "despite",
        .type = Type::texts,
        .sentence = "What spoke against it when somebody insisted on it.",
        .fallback = "nothing"},
    Key{.path = "point",
        .type = Type::points,
        .sentence = "The points that it was made from, in the order in which they were taken.",
        .fallback = "not told"},
};

/// The keys of a calibration that held before: those of one that holds, and which channel.
constexpr auto history_table = [] {
  std::array<Key, calibration_table.size() + 1> keys{Key{
      .path = "channel",
      .type = Type::choice,
      .sentence = "The channel whose calibration it was.",
      .need = Need::always,
      .choices = "displacement|velocity|friction_force|normal_load|base_displacement|drive_force"}};
  for (std::size_t i = 0; i < calibration_table.size(); ++i) keys[i + 1] = calibration_table[i];
  return keys;
}();

constexpr std::array point_table = {
    Key{.path = "raw",
        .type = Type::number,
        .unit = "raw",
        .sentence = "Mean reading.",
        .need = Need::always},
    Key{.path = "raw_std",
        .type = Type::number,
        .unit = "raw",
        .sentence = "Standard deviation of that mean.",
        .fallback = "0: not known",
        .low = 0},
    Key{.path = "reference_si",
        .type = Type::number,
        .unit = "SI",
        .sentence = "What the channel was made to measure.",
        .need = Need::always},
    Key{.path = "reference_sigma",
        .type = Type::number,
        .unit = "SI",
        .sentence = "Standard uncertainty of it.",
        .fallback = "0",
        .low = 0},
};

/// As a person writes it.
std::string bound_text(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string range_text(const Key& key) {
  const bool low = std::isfinite(key.low);
  const bool high = std::isfinite(key.high);
  if (low && high) {
    return key.low == key.high ? bound_text(key.low)
                               : (key.above_low ? "above " : "from ") + bound_text(key.low) +
                                     " to " + bound_text(key.high);
  }
  if (low) return key.above_low ? "above " + bound_text(key.low) : bound_text(key.low) + " or more";
  if (high) return bound_text(key.high) + " or less";
  return "";
}

std::string quoted_choices(std::string_view list, std::string_view last) {
  const auto choices = choices_of(list);
  std::string text;
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (i > 0) text += i + 1 == choices.size() ? last : ", ";
    text += '"' + std::string(choices[i]) + '"';
  }
  return text;
}

}  // namespace

std::string_view name_of(Type type) {
  switch (type) {
    case Type::number:
      return "number";
    case Type::integer:
      return "whole number";
    case Type::boolean:
      return "true or false";
    case Type::text:
      return "text";
    case Type::choice:
      return "choice";
    case Type::file:
      return "path";
    case Type::parameter:
      return "parameter";
    case Type::filters:
      return "filters";
    case Type::envelope:
      return "points";
    case Type::lines:
      return "lines";
    case Type::terms:
    case Type::faults:
    case Type::points:
    case Type::history:
    case Type::gauges:
    case Type::modbus_units:
    case Type::registers:
      return "tables";
    case Type::integers:
      return "whole numbers";
    case Type::span:
      return "two numbers";
    case Type::date:
      return "date";
    case Type::texts:
      return "texts";
    case Type::range:
      return "[low, high]";
    case Type::covariance:
      return "three numbers";
    case Type::leaks:
      return "{ CHANNEL = number }";
    case Type::calibration:
      return "table";
  }
  return "";
}

std::string range_of(const Key& key) {
  return key.type == Type::choice ? quoted_choices(key.choices, ", ") : range_text(key);
}

std::string absence_of(const Key& key) {
  if (key.need == Need::optional) return std::string(key.fallback);
  std::string text = "required";
  if (key.need == Need::in_table) {
    text += " in [" + std::string(key.path.substr(0, key.path.rfind('.'))) + "]";
  }
  if (!key.when.empty()) {
    const auto equals = key.when.find('=');
    const auto dot = key.when.substr(0, equals).rfind('.');
    const auto name = dot == std::string_view::npos ? key.when.substr(0, equals)
                                                    : key.when.substr(dot + 1, equals - dot - 1);
    text += " with " + std::string(name) + " ";
    for (char c : key.when.substr(equals + 1))
      text += c == '|' ? std::string(" or ") : std::string(1, c);
    if (key.only_then) text += "; not otherwise";
  }
  return text;
}

namespace {

/// `live`: with a column that says what a running daemon takes over.
void list(std::ostringstream& page, std::span<const Key> keys, bool live = false) {
  page << "| key | type | unit | range | without it |" << (live ? " live |" : "") << " meaning |\n"
       << "| --- | --- | --- | --- | --- |" << (live ? " --- |" : "") << " --- |\n";
  for (const Key& key : keys) {
    std::string path(key.path);
    const auto star = path.find('*');
    if (star != std::string::npos) path.replace(star, 1, "CHANNEL");
    page << "| `" << path << "` | " << name_of(key.type) << " | " << key.unit << " | "
         << range_of(key) << " | " << absence_of(key) << " | ";
    if (live) page << (key.live ? "yes" : "") << " | ";
    page << key.sentence << " |\n";
  }
}

}  // namespace

std::span<const Key> model_keys() { return model_table; }
std::span<const Key> filter_keys() { return filter_table; }
std::span<const Key> term_keys() { return term_table; }
std::span<const Key> rig_keys() { return rig_table; }
std::span<const Key> fault_script_keys() { return fault_script_table; }
std::span<const Key> fault_keys() { return fault_table; }
std::span<const Key> fault_amount_keys() { return fault_amount_table; }

std::vector<Key> fault_keys_of(std::string_view kind) {
  std::vector<Key> keys(fault_table.begin(), fault_table.end());
  const Key* amount = find_key(fault_amount_table, kind);
  if (amount == nullptr) return keys;
  for (Key& key : keys) {
    if (key.path != "amount") continue;
    key.unit = amount->unit;
    key.sentence = amount->sentence;
    key.low = amount->low;
    key.high = amount->high;
    key.above_low = amount->above_low;
  }
  return keys;
}
std::span<const Key> calibration_file_keys() { return calibration_file_table; }
std::span<const Key> calibration_keys() { return calibration_table; }
std::span<const Key> history_keys() { return history_table; }
std::span<const Key> point_keys() { return point_table; }
std::span<const Key> gauge_keys() { return gauge_table; }
std::span<const Key> modbus_unit_keys() { return modbus_unit_table; }
std::span<const Key> modbus_map_keys() { return modbus_map_table; }
std::span<const Key> register_keys() { return register_table; }

bool matches(const Key& key, std::string_view path) {
  const auto star = key.path.find('*');
  if (star == std::string_view::npos) return key.path == path;
  const std::string_view after = key.path.substr(star + 1);
  if (path.size() < star + after.size() || path.substr(0, star) != key.path.substr(0, star) ||
      path.substr(path.size() - after.size()) != after) {
    return false;
  }
  const std::string_view stem = path.substr(star, path.size() - star - after.size());
  for (const ChannelInfo& channel : channel_table) {
    if (channel.stem == stem) return true;
  }
  return false;
}

const Key* find_key(std::span<const Key> keys, std::string_view path) {
  for (const Key& key : keys) {
    if (matches(key, path)) return &key;
  }
  return nullptr;
}

std::vector<std::string_view> choices_of(std::string_view list) {
  std::vector<std::string_view> choices;
  while (!list.empty()) {
    const auto bar = list.find('|');
    choices.push_back(list.substr(0, bar));
    list = bar == std::string_view::npos ? std::string_view{} : list.substr(bar + 1);
  }
  return choices;
}

std::string_view choice_at(std::span<const Key> keys, std::string_view path, std::size_t position) {
  return choices_of(find_key(keys, path)->choices).at(position);
}

std::string number_text(double value) {
  std::array<char, 40> digits{};
  const double size = std::abs(value);
  const bool plain = size == 0.0 || (size >= 1.0e-4 && size < 1.0e9);
  const auto result =
      std::to_chars(digits.data(), digits.data() + digits.size(), value,
                    plain ? std::chars_format::fixed : std::chars_format::scientific);
  std::string text(digits.data(), result.ptr);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string string_text(std::string_view value) {
  std::string text = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      text += '\\';
      text += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      std::array<char, 8> escape{};
      std::snprintf(escape.data(), escape.size(), "\\u%04X", static_cast<unsigned>(c));
      text += escape.data();
    } else {
      text += c;
    }
  }
  return text + '"';
}

std::string expectation(const Key& key) {
  std::string text;
  switch (key.type) {
    case Type::number:
      text = "a number";
      break;
    case Type::integer:
      text = "a whole number";
      break;
    case Type::boolean:
      return "true or false";
    case Type::text:
      return "a text in quotes";
    case Type::choice:
      return quoted_choices(key.choices, " or ");
    case Type::file:
      return "the path of a file in quotes";
    case Type::parameter:
      text = "a number or { value = ..., sigma = ... }";
      break;
    case Type::filters:
      return "a list of filters, [ { kind = \"butterworth_lowpass\", order = 4, cutoff_hz = 25.0 } "
             "]";
    case Type::envelope:
      return "a list of points, [[time_s, amplitude], ...]";
    case Type::lines:
      return "a list of lines, [[frequency_hz, amplitude, phase_deg], ...]";
    case Type::terms:
      return "[[physics]] tables";
    case Type::span:
      text = "two numbers, [from, to], the second larger";
      break;
    case Type::faults:
      return "[[fault]] tables";
    case Type::date:
      return "a date in quotes, such as \"2026-11-22\" or \"2026-11-22T14:03:00Z\"";
    case Type::texts:
      return "a list of texts in quotes";
    case Type::range:
      return "[low, high] with low below high [" + std::string(key.unit) + "]";
    case Type::covariance:
      return "[variance of the offset, covariance, variance of the gain]";
    case Type::leaks:
      return "{ CHANNEL = number, ... } with the names of other channels";
    case Type::points:
      return "[[...point]] tables";
    case Type::calibration:
      return "a table with offset, gain, date, reference";
    case Type::history:
      return "[[history]] tables";
    case Type::gauges:
      return "[[gauge]] tables";
    case Type::modbus_units:
      return "[[modbus]] tables";
    case Type::registers:
      return "[[register]] tables";
    case Type::integers:
      return "a list of whole numbers, [0, 1]";
  }
  const std::string range = range_text(key);
  if (!range.empty()) text += ", " + range;
  if (!key.unit.empty() && key.unit != "1" && key.unit.find(" or ") == std::string_view::npos &&
      key.unit.find("the ") != 0) {
    text += " [" + std::string(key.unit) + "]";
  }
  return text;
}

std::string keys_page() {
  std::ostringstream page;
  page << "# Configuration\n"
          "\n"
          "`stickslip check --keys` prints this page from the table that files are checked "
          "against; a\n"
          "test holds the two together.\n"
          "\n"
          "`stickslip check FILE...` tells everything that is wrong with a rig, a model, a fault "
          "script or a\n"
          "calibration at once, with line and column, without a daemon. Files are TOML. A key that "
          "does not exist is an "
          "error, so\n"
          "a misspelt one is never passed over in silence. CHANNEL stands for `displacement`,\n"
          "`velocity`, `friction_force`, `normal_load`, `base_displacement` or `drive_force`. "
          "Paths are\n"
          "relative to the file that names them.\n"
          "\n"
          "## Rigs\n"
          "\n"
          "What `stickslipd --config` reads; [`config/simulated.toml`](../config/simulated.toml) "
          "is one.\n"
          "`stickslip config RIG.toml --explain` tells the value of each key in a rig and where it "
          "comes\n"
          "from. Live: a running daemon takes a new value over when it is told to read its file "
          "again\n"
          "(`SIGHUP`); the others need a restart, and it says so.\n"
          "\n";
  list(page, rig_keys(), true);
  page << "\n"
          "Each `[[modbus]]` table:\n"
          "\n";
  list(page, modbus_unit_keys());
  page << "\n"
          "Each `[[gauge]]` table:\n"
          "\n";
  list(page, gauge_keys());
  page << "\n"
          "## Register maps\n"
          "\n"
          "What `map` of a Modbus unit names; [`config/modbus/`](../config/modbus) holds two, and\n"
          "[hardware.md](hardware.md) says how to write another.\n"
          "\n";
  list(page, modbus_map_keys());
  page << "\n"
          "Each `[[register]]` table:\n"
          "\n";
  list(page, register_keys());
  page << "\n"
          "## Models\n"
          "\n"
          "The physics that a rig's owner believes in, as in\n"
          "[`config/models/simulated.toml`](../config/models/simulated.toml). A parameter that is "
          "a\n"
          "plain number is known exactly; `{ value = 0.06, sigma = 0.0006 }` is known with that "
          "standard\n"
          "deviation and is calibrated on a recording before anything is called missing.\n"
          "\n";
  list(page, model_keys());
  page << "\n"
          "Each filter of `filters`:\n"
          "\n";
  list(page, filter_keys());
  page << "\n"
          "Each `[[physics]]` table:\n"
          "\n";
  list(page, term_keys());
  page
      << "\n"
         "## Fault scripts\n"
         "\n"
         "What `driver.faults` names; [`config/faults/`](../config/faults) holds one for each kind "
         "of fault,\n"
         "and [faults.md](faults.md) says what each does.\n"
         "\n";
  list(page, fault_script_keys());
  page << "\n"
          "Each `[[fault]]` table:\n"
          "\n";
  list(page, fault_keys());
  page << "\n"
          "Its `amount`, by kind; channels are in the device's own units, before calibration:\n"
          "\n";
  list(page, fault_amount_keys());
  page << "\n"
          "## Calibrations\n"
          "\n"
          "What `calibration.file` of a rig names, as in\n"
          "[`config/calibrations/beam.toml`](../config/calibrations/beam.toml); "
          "[calibration.md](calibration.md) says how one\n"
          "is made.\n"
          "\n";
  list(page, calibration_file_keys());
  page << "\n"
          "Each `[channel.CHANNEL]`, and each `[[history]]` table, which also has `channel`, the "
          "name of its channel:\n"
          "\n";
  list(page, calibration_keys());
  page << "\n"
          "Each `[[channel.CHANNEL.point]]`:\n"
          "\n";
  list(page, point_keys());
  return page.str();
}

}  // namespace stickslip::config
