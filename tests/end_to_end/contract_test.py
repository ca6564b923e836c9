# SPDX-License-Identifier: Apache-2.0
"""The contract checker finds every fault: valid reports, each invalidated in one place."""
import copy
import unittest

from contract import faults_of_diagnosis, faults_of_evaluation
from programs import main

SCORES = {"nll_per_sample": -4.0, "chi2_per_sample": 9.7, "nrmse": {"displacement": 0.12}}
DIAGNOSIS = {
    "schema": 1,
    "verdict": "missing_physics",
    "location": {"relation": "force_balance", "channel": "displacement", "when_s": [[0.0, 60.0]],
                 "where": {"displacement_m": [0.012, 0.031]}, "band_hz": [2.1, 8.0],
                 "statement": "one sentence",
                 "balances": {"kinematics": {"excess": 1.0, "p": 0.6},
                              "force_balance": {"excess": 41.2, "p": 1e-9},
                              "friction_law": {"excess": 1.1, "p": 0.2}, "normal_load": None,
                              "excitation": {"excess": 1.0, "p": 0.5}}},
    "findings": [{
        "id": "cubic_stiffness", "relation": "force_balance", "channel": None,
        "statement": "The spring hardens.", "equation": "k3 x^3 added to the restoring force",
        "parameters": {"k3_n_m3": {"value": 1.0e4, "unit": "N/m3", "ci95": [0.9e4, 1.1e4],
                                   "formula_uncertainty": 0.0}},
        "score_gain": {"value": 812.0, "se": 33.0, "unit": "nat"}, "preferred_over": [],
        "probability": 0.99, "alternatives": [{"id": "end_stop", "probability": 0.01}],
        "separating_experiment": None}],
    "fit": {"heldout": {"baseline": SCORES, "augmented": SCORES}, "horizon_s": 0.4,
            "windows": {"fit": 60, "select": 30, "report": 30}},
    "calibration": {"oscillator.mass_kg": {"value": 0.0601, "ci95": [0.0598, 0.0604],
                                           "declared": 0.060, "declared_sigma": 0.0006,
                                           "unit": "kg"}},
    "noise": {"displacement": {"std": 2.0e-5, "correlation_s": 0.0, "source": "declared"}},
    "tried": [{"ids": ["cubic_stiffness"], "score_gain": 812.0, "se": 33.0}],
    "provenance": {"version": "0.2.0", "seed": 1, "command": "stickslip diagnose",
                   "sha256": {"recording.csv": 64 * "0"}},
    "calibrated": {"oscillator.mass_kg": 0.0601},
    "noise_std": {"displacement_m": 2.0e-5},
}
EVALUATION = {"schema": 1, "fit": {**SCORES, "rmse": {"displacement_m": 1e-4}}, "horizon_s": 0.4,
              "free_run": {"rmse": {"displacement_m": 1e-3}, "nrmse": {"displacement": 0.1}}}
MISSING = object()

# Place, invalid value, and an excerpt of the expected fault.
INVALID_DIAGNOSES = [
    (["schema"], 2, "schema"),
    (["verdict"], "fine", "verdict"),
    (["verdict"], "consistent", "findings"),
    (["findings"], [], "without findings"),
    (["location"], None, "location"),
    (["location", "relation"], "spring", "relation"),
    (["location", "channel"], "displacement_m", "channel"),
    (["location", "when_s"], [[3.0, 1.0]], "when_s"),
    (["location", "where"], {"displacement": [0, 1]}, "not a column"),
    (["location", "band_hz"], [2.0], "band_hz"),
    (["location", "statement"], " ", "statement"),
    (["location", "balances"], {"kinematics": None}, "lacks excitation"),
    (["location", "balances", "friction_law"], {"excess": -1.0, "p": 0.5}, "excess"),
    (["findings", 0, "relation"], "friction_law", "belongs to force_balance"),
    (["findings", 0, "relation"], "sensor", "without a channel"),
    (["findings", 0, "parameters"],
     {"k3": {"value": 1, "unit": "1", "ci95": [0, 2], "formula_uncertainty": 0}}, "lacks k3_n_m3"),
    (["findings", 0, "parameters", "k3_n_m3", "ci95"], [2.0e4, 3.0e4], "outside its ci95"),
    (["findings", 0, "parameters", "k3_n_m3", "value"], float("nan"), "value"),
    (["findings", 0, "probability"], 1.2, "probability"),
    (["findings", 0, "alternatives", 0, "probability"], 0.5, "add up"),
    (["findings", 0, "separating_experiment"], "", "separating_experiment"),
    (["findings", 0, "id"], "unlisted", "depends_on"),
    (["findings", 0, "equation"], MISSING, "lacks equation"),
    (["fit", "horizon_s"], 0, "horizon_s"),
    (["fit", "heldout", "augmented"], MISSING, "lacks augmented"),
    (["fit", "heldout", "baseline", "chi2_per_sample"], -1, "chi2_per_sample"),
    (["fit", "heldout", "baseline", "nrmse"], {"displacement_m": 0.1}, "unknown name"),
    (["calibrated"], {"mass": 1.0}, "not a path"),
    (["noise_std"], {"displacement": 1.0}, "unknown name"),
    (["noise_std"], MISSING, "lacks noise_std"),
    (["findings", 0, "parameters", "k3_n_m3", "unit"], "", "unit"),
    (["findings", 0, "parameters", "k3_n_m3", "formula_uncertainty"], -1, "formula_uncertainty"),
    (["findings", 0, "score_gain", "se"], MISSING, "lacks se"),
    (["findings", 0, "preferred_over"], MISSING, "lacks preferred_over"),
    (["fit", "windows", "report"], MISSING, "lacks report"),
    (["calibration"], {}, "other parameters"),
    (["calibration", "oscillator.mass_kg", "ci95"], [2.0], "ci95"),
    (["noise", "displacement", "source"], "guessed", "source"),
    (["tried", 0, "ids"], [], "ids"),
    (["provenance", "sha256"], {"recording.csv": "0"}, "sha256"),
]
INVALID_EVALUATIONS = [
    (["free_run"], MISSING, "lacks free_run"),
    (["free_run", "rmse"], MISSING, "lacks rmse"),
    (["fit", "rmse"], {"displacement": 1.0}, "unknown name"),
    (["fit", "nll_per_sample"], None, "nll_per_sample"),
    (["horizon_s"], -0.4, "horizon_s"),
]


def invalidated(report, path, value):
    report = copy.deepcopy(report)
    *way, last = path
    table = report
    for key in way:
        table = table[key]
    if value is MISSING:
        del table[last]
    else:
        table[last] = value
    return report


class Contract(unittest.TestCase):
    def test_valid_reports(self):
        self.assertEqual(faults_of_diagnosis(DIAGNOSIS), [])
        self.assertEqual(faults_of_evaluation(EVALUATION), [])
        self.assertEqual(faults_of_evaluation({**EVALUATION, "free_run": None}), [])

    def test_every_fault_is_found(self):
        for check, report, cases in ((faults_of_diagnosis, DIAGNOSIS, INVALID_DIAGNOSES),
                                     (faults_of_evaluation, EVALUATION, INVALID_EVALUATIONS)):
            for path, value, word in cases:
                with self.subTest(path=path, value=value):
                    faults = check(invalidated(report, path, value))
                    self.assertTrue(any(word in fault for fault in faults), faults)


if __name__ == "__main__":
    main()
