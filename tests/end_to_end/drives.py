# SPDX-License-Identifier: Apache-2.0
"""Drives of simulated recordings."""
import math


def modulated_sweep(seconds, amplitude_n, swing_n, from_hz):
    """A force whose amplitude swings over 7 s while its frequency rises from `from_hz`, as CSV at 500 Hz."""
    lines = ["time_s,drive_force_n"]
    for i in range(seconds * 500 + 1):
        t = i / 500
        amplitude = amplitude_n + swing_n * math.sin(2 * math.pi * t / 7)
        lines.append(f"{t:.3f},{amplitude * math.sin(2 * math.pi * (from_hz + 0.05 * t) * t):.9f}")
    return "\n".join(lines) + "\n"
