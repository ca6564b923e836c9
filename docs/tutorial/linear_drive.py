#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes two recordings of a simulated linear drive: a carriage on a ball screw that a position controller
moves from point to point, like the EMPS of Janot, Gautier and Brunot (2019). Random numbers are seeded.

Usage: linear_drive.py FIRST.csv SECOND.csv
"""
import math
import random
import sys

MASS_KG = 95.1
VISCOUS_N_S_M = 203.5
COULOMB_N = 20.4
OFFSET_N = 3.2  # a constant force on the carriage, towards +x

STEP_S = 0.0005
ROW_S = 0.004
AMPLIFIER_LAG_S = 0.008
POSITION_NOISE_M = 1e-5
FORCE_NOISE_N = 0.2


def moves_between(targets, speed_m_s):
    """(start, length, from, to) of the moves to each target in turn, with rests between, and the end of all."""
    moves, start_s, position_m = [], 0.5, 0.0
    for target in targets:
        length_s = 1.9 * abs(target - position_m) / speed_m_s
        moves.append((start_s, length_s, position_m, target))
        start_s += length_s + 0.3
        position_m = target
    return moves, start_s


def wanted(moves, time_s):
    """Position and speed that the controller follows."""
    position_m, speed_m_s = 0.0, 0.0
    for start_s, length_s, begin_m, end_m in moves:
        if time_s < start_s:
            break
        share = min(1.0, (time_s - start_s) / length_s)
        position_m = begin_m + (end_m - begin_m) * share**3 * (10 - 15 * share + 6 * share**2)
        speed_m_s = (end_m - begin_m) * 30 * share**2 * (1 - share)**2 / length_s
    return position_m, speed_m_s


def after_step(position_m, speed_m_s, force_n):
    """Position and speed after a step; the carriage sticks while the force does not overcome friction."""
    pushed = speed_m_s + STEP_S * (force_n + OFFSET_N - VISCOUS_N_S_M * speed_m_s) / MASS_KG
    braked = STEP_S * COULOMB_N / MASS_KG
    moved = math.copysign(max(0.0, abs(pushed) - braked), pushed)
    return position_m + STEP_S * moved, moved


def rows(targets, speed_m_s, seed):
    noise = random.Random(seed)
    moves, end_s = moves_between(targets, speed_m_s)
    position_m = speed = force_n = 0.0
    per_row = round(ROW_S / STEP_S)
    for step in range(round(end_s / STEP_S)):
        time_s = step * STEP_S
        if step % per_row == 0:
            yield (time_s, position_m + noise.gauss(0, POSITION_NOISE_M), force_n + noise.gauss(0, FORCE_NOISE_N))
        to_m, at_m_s = wanted(moves, time_s)
        command_n = 3e4 * (to_m - position_m) + 2e3 * (at_m_s - speed)
        force_n += STEP_S / AMPLIFIER_LAG_S * (command_n - force_n)
        position_m, speed = after_step(position_m, speed, force_n)


def write(file, targets, speed_m_s, seed):
    with open(file, "w", encoding="utf-8") as out:
        out.write("time_s,displacement_m,drive_force_n\n")
        out.writelines(f"{t:.3f},{x:.6f},{f:.2f}\n" for t, x, f in rows(targets, speed_m_s, seed))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    write(sys.argv[1], (0.10, -0.08, 0.12, 0.02, 0.09, -0.05, 0.0, 0.08, -0.10, 0.0), 0.12, 1)
    write(sys.argv[2], (-0.06, 0.06, 0.0, -0.12, 0.05, -0.02, 0.07, 0.0), 0.15, 2)
