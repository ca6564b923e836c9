# SPDX-License-Identifier: Apache-2.0
"""A sine of known amplitude on the simulated rig, received over LCM in SI units and to within the noise
by a subscriber that shares no code with the daemon."""
import json
import math
import os
import subprocess
import sys
import time
import unittest

from programs import PATIENCE_S, SOURCE, STICKSLIPD, EndToEnd, main

AMPLITUDE_M = 0.004
CARRIER_HZ = 3.0
PERIODS = 12
NOISE_M = 2.0e-5

MODEL = f"""schema = 1
[oscillator]
excitation = "base"
mass_kg = 0.06
natural_frequency_hz = 2.4
damping_ratio = 0.05
[normal_load]
law = "constant"
load_n = 0.15
[friction]
law = "coulomb"
mu = 0.2
transition_speed_m_s = 0.0025
[sensors.base_displacement]
noise_std = {NOISE_M}
[sensors.displacement]
noise_std = {NOISE_M}
"""
RIG = f"""schema = 1
[rig]
name = "sine"
model = "model.toml"
[driver]
kind = "simulated"
[driver.simulated]
truth = "model.toml"
seed = 7
[loop]
rate_hz = 1000.0
[control]
start_at_once = true

[excitation]
enabled = true
carrier_hz = {CARRIER_HZ}
amplitude = {AMPLITUDE_M}
ramp_s = 0.5
"""


def solve(matrix, right):
    """Gaussian elimination with pivoting; small systems."""
    n = len(right)
    rows = [row[:] + [value] for row, value in zip(matrix, right)]
    for i in range(n):
        pivot = max(range(i, n), key=lambda r: abs(rows[r][i]))
        rows[i], rows[pivot] = rows[pivot], rows[i]
        for r in range(i + 1, n):
            factor = rows[r][i] / rows[i][i]
            rows[r] = [a - factor * b for a, b in zip(rows[r], rows[i])]
    solution = [0.0] * n
    for i in reversed(range(n)):
        solution[i] = (rows[i][n] - sum(rows[i][j] * solution[j] for j in range(i + 1, n))) / rows[i][i]
    return solution


def fit_sine(times, values, frequency_hz):
    """(amplitude, standard deviation of the residual) of a fit of offset + sine."""
    basis = [[1.0, math.sin(2 * math.pi * frequency_hz * t), math.cos(2 * math.pi * frequency_hz * t)]
             for t in times]
    normal = [[sum(b[i] * b[j] for b in basis) for j in range(3)] for i in range(3)]
    right = [sum(b[i] * v for b, v in zip(basis, values)) for i in range(3)]
    c = solve(normal, right)
    left = [v - sum(ci * bi for ci, bi in zip(c, b)) for b, v in zip(basis, values)]
    return math.hypot(c[1], c[2]), math.sqrt(sum(r * r for r in left) / (len(left) - 3))


class SineOnLcm(EndToEnd):
    def test_amplitude_noise_and_completeness(self):
        self.write("model.toml", MODEL)
        rig = self.write("rig.toml", RIG)
        seconds = PERIODS / CARRIER_HZ + 1.0
        daemon = subprocess.Popen([STICKSLIPD, "--config", str(rig), "--duration", str(seconds + 4)],
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.addCleanup(daemon.wait)
        self.addCleanup(daemon.kill)
        time.sleep(1.5)
        heard = subprocess.run(
            [sys.executable, SOURCE / "tests/end_to_end/lcm_subscriber.py", "--duration", str(seconds),
             "--frames"], capture_output=True, text=True, timeout=PATIENCE_S)
        output, _ = daemon.communicate(timeout=PATIENCE_S)
        self.assertEqual(heard.returncode, 0, heard.stderr + output)
        self.assertEqual(daemon.returncode, 0, output)

        frames = [json.loads(line) for line in heard.stdout.splitlines()]
        # After the ramp of half a second and the transient of the shaker's filter.
        self.assertGreater(len(frames), 900 * seconds, output)
        sequences = [frame["sequence"] for frame in frames]
        self.assertEqual(sequences, list(range(sequences[0], sequences[0] + len(sequences))))

        count = int(PERIODS / CARRIER_HZ * 1000)
        last = frames[-count:]
        times = [frame["time_ns"] * 1e-9 for frame in last]
        amplitude, left = fit_sine(times, [frame["base_displacement_m"] for frame in last], CARRIER_HZ)
        # Five standard deviations of the fit, and the effect of a 60 Hz shaker filter at 3 Hz.
        uncertainty = 5 * NOISE_M * math.sqrt(2 / count)
        self.assertAlmostEqual(amplitude, AMPLITUDE_M, delta=uncertainty + 2e-4 * AMPLITUDE_M)
        self.assertAlmostEqual(left / NOISE_M, 1.0, delta=0.1)
        for frame in last:
            self.assertTrue(math.isfinite(frame["displacement_m"]))
        # The pad slips.
        self.assertGreater(max(abs(frame["displacement_m"]) for frame in last), 1e-3)


if __name__ == "__main__":
    main()
