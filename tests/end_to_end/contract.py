# SPDX-License-Identifier: Apache-2.0
"""Checks reports of `diagnose` and `evaluate`, of any program, against the contract.

Each function returns a list of faults, empty for a valid report. As a program: contract.py
REPORT.json ...
"""
import json
import math
import sys

COLUMNS = {
    "displacement": "displacement_m", "velocity": "velocity_m_s",
    "friction_force": "friction_force_n", "normal_load": "normal_load_n",
    "base_displacement": "base_displacement_m", "drive_force": "drive_force_n",
}
STEMS = set(COLUMNS)
VERDICTS = {"consistent", "missing_physics", "unexplained"}
BALANCES = ["kinematics", "force_balance", "friction_law", "normal_load", "excitation"]
RELATIONS = {"kinematics", "force_balance", "friction_law", "normal_load", "load_cell", "sensor"}
# id: relation, parameters
CATALOGUE = {
    "dry_friction": ("friction_law", {"friction_force_n"}),
    "friction_memory": ("friction_law", {"gamma_per_s"}),
    "stribeck": ("friction_law", {"static_ratio", "stribeck_speed_m_s"}),
    "dwell_strengthening": ("friction_law", {"beta", "tau_s"}),
    "contact_compliance": ("friction_law", {"contact_stiffness_n_m"}),
    "load_dependent_mu": ("friction_law", {"exponent"}),
    "asymmetric_friction": ("friction_law", {"asymmetry"}),
    "position_dependent_mu": ("friction_law", {"slope_per_m"}),
    "friction_drift": ("friction_law", {"rate_per_s"}),
    "quadratic_drag": ("force_balance", {"drag_n_s2_m2"}),
    "cubic_stiffness": ("force_balance", {"k3_n_m3"}),
    "hysteresis": ("force_balance", {"stiffness_n_m", "slip_force_n"}),
    "end_stop": ("force_balance", {"gap_m", "stiffness_n_m"}),
    "bias_force": ("force_balance", {"force_n"}),
    "ambient_vibration": ("force_balance", {"frequency_hz", "amplitude_n"}),
    "second_mode": ("force_balance", {"frequency_hz"}),
    "wedge_load": ("normal_load", {"slope_per_m"}),
    "load_cell_resonance": ("load_cell", {"frequency_hz", "damping_ratio"}),
    "differentiator_lag": ("kinematics", {"cutoff_hz"}),
    "channel_delay": ("sensor", {"delay_s"}),
    "gain_error": ("sensor", {"gain"}),
    "crosstalk": ("sensor", {"coefficient"}),
    "clipping": ("sensor", {"limit"}),
    "mains_hum": ("sensor", {"frequency_hz", "amplitude"}),
    "sensor_drift": ("sensor", {"rate_per_s"}),
}


def is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def is_text(value):
    return isinstance(value, str) and bool(value.strip())


class Faults(list):
    """Faults found, one sentence each."""

    def expect(self, condition, sentence):
        if not condition:
            self.append(sentence)
        return bool(condition)

    def keys(self, table, required, path):
        """True if `table` is a table with these keys; further ones are allowed."""
        if not self.expect(isinstance(table, dict), f"{path} is not a table"):
            return False
        missing = sorted(set(required) - set(table))
        return self.expect(not missing, f"{path} lacks {', '.join(missing)}")

    def span(self, value, path):
        self.expect(isinstance(value, list) and len(value) == 2 and all(map(is_number, value))
                    and value[0] <= value[1], f"{path} is not a pair [low, high]: {value}")

    def numbers(self, table, names, path, least=None):
        """Checks a table of numbers whose keys are among `names`."""
        if not self.expect(isinstance(table, dict), f"{path} is not a table"):
            return
        for key, value in table.items():
            self.expect(key in names, f"{path}.{key} is an unknown name")
            self.expect(is_number(value) and (least is None or value >= least),
                        f"{path}.{key} is {value}")


def check_location(location, verdict, faults):
    if location is None:
        faults.expect(verdict == "consistent", "location is null although there is a mismatch")
        return
    if not faults.keys(location, ["relation", "channel", "when_s", "where", "band_hz", "statement",
                                  "balances"], "location"):
        return
    if faults.keys(location["balances"], BALANCES, "location.balances"):
        for name, balance in location["balances"].items():
            if balance is not None:
                faults.numbers(balance, {"excess", "p"}, f"location.balances.{name}", least=0)
    relation, channel = location["relation"], location["channel"]
    if verdict != "consistent" or relation is not None:
        faults.expect(relation in RELATIONS, f"location.relation is {relation}")
        faults.expect(is_text(location["statement"]), "location.statement is empty")
    faults.expect(channel is None or channel in STEMS, f"location.channel is {channel}")
    when = location["when_s"]
    if faults.expect(isinstance(when, list), "location.when_s is not a list"):
        for i, stretch in enumerate(when):
            faults.span(stretch, f"location.when_s[{i}]")
        faults.expect(verdict == "consistent" or when, "location.when_s is empty")
    where = location["where"]
    if faults.expect(where is None or isinstance(where, dict), "location.where is not a table"):
        for column, span in (where or {}).items():
            faults.expect(column in COLUMNS.values(), f"location.where.{column} is not a column")
            faults.span(span, f"location.where.{column}")
    if location["band_hz"] is not None:
        faults.span(location["band_hz"], "location.band_hz")


def check_finding(finding, path, faults):
    if not faults.keys(finding, ["id", "relation", "channel", "statement", "equation", "parameters",
                                 "probability", "alternatives", "separating_experiment", "score_gain",
                                 "preferred_over"], path):
        return
    if faults.keys(finding["score_gain"], ["value", "se", "unit"], f"{path}.score_gain"):
        faults.numbers({key: finding["score_gain"][key] for key in ("value", "se")},
                       {"value", "se"}, f"{path}.score_gain")
        faults.expect(finding["score_gain"]["unit"] == "nat", f"{path}.score_gain.unit")
    for other in finding["preferred_over"]:
        faults.expect(is_text(other.get("id")), f"{path}.preferred_over holds {other}")
    name, relation, channel = finding["id"], finding["relation"], finding["channel"]
    parameters = finding["parameters"]
    faults.expect(relation in RELATIONS, f"{path}.relation is {relation}")
    faults.expect(channel is None or channel in STEMS, f"{path}.channel is {channel}")
    faults.expect(relation != "sensor" or channel is not None,
                  f"{path} is a sensor error without a channel")
    for key in ("id", "statement", "equation"):
        faults.expect(is_text(finding[key]), f"{path}.{key} is empty")
    if not faults.expect(isinstance(parameters, dict), f"{path}.parameters is not a table"):
        return
    if name in CATALOGUE:
        expected_relation, expected = CATALOGUE[name]
        faults.expect(relation == expected_relation,
                      f"{path}.relation is {relation}; {name} belongs to {expected_relation}")
        missing = sorted(expected - set(parameters))
        faults.expect(not missing, f"{path}.parameters lacks {', '.join(missing)}")
    elif name == "declared_value":
        faults.expect(is_text(finding.get("parameter")), f"{path}.parameter is not a path")
        faults.expect("value" in parameters, f"{path}.parameters lacks value")
    elif name == "unlisted":
        depends = parameters.get("depends_on")
        faults.expect(isinstance(depends, list) and depends
                      and all(on in STEMS | {"time"} for on in depends),
                      f"{path}.parameters.depends_on is {depends}")
    for key, parameter in parameters.items():
        if key == "depends_on":
            continue
        here = f"{path}.parameters.{key}"
        if faults.keys(parameter, ["value", "unit", "ci95", "formula_uncertainty"], here):
            faults.expect(is_text(parameter["unit"]), f"{here}.unit is {parameter['unit']}")
            faults.expect(is_number(parameter["formula_uncertainty"])
                          and parameter["formula_uncertainty"] >= 0,
                          f"{here}.formula_uncertainty is {parameter['formula_uncertainty']}")
            faults.expect(is_number(parameter["value"]), f"{here}.value is {parameter['value']}")
            faults.span(parameter["ci95"], f"{here}.ci95")
            if is_number(parameter["value"]) and isinstance(parameter["ci95"], list) \
                    and len(parameter["ci95"]) == 2 and all(map(is_number, parameter["ci95"])):
                low, high = parameter["ci95"]
                faults.expect(low <= parameter["value"] <= high, f"{here} lies outside its ci95")
    total = finding["probability"]
    faults.expect(is_number(total) and 0 <= total <= 1, f"{path}.probability is {total}")
    if faults.expect(isinstance(finding["alternatives"], list), f"{path}.alternatives is not a list"):
        for i, other in enumerate(finding["alternatives"]):
            here = f"{path}.alternatives[{i}]"
            if not faults.keys(other, ["id", "probability"], here):
                continue
            # Other numbers, and other unlisted physics, have the same id.
            same = all(other.get(key) == finding.get(key) for key in ("id", "parameter", "name"))
            faults.expect(is_text(other["id"]) and not same, f"{here}.id is {other['id']}")
            chance = other["probability"]
            if faults.expect(is_number(chance) and 0 <= chance <= 1,
                             f"{here}.probability is {chance}") and is_number(total):
                total += chance
        faults.expect(not is_number(total) or total <= 1.001,
                      f"{path}: the probabilities add up to {total}")
    experiment = finding["separating_experiment"]
    faults.expect(experiment is None or is_text(experiment),
                  f"{path}.separating_experiment is empty")


def check_scores(scores, path, faults):
    if not faults.keys(scores, ["nll_per_sample", "chi2_per_sample", "nrmse"], path):
        return
    faults.expect(is_number(scores["nll_per_sample"]), f"{path}.nll_per_sample is not a number")
    faults.expect(is_number(scores["chi2_per_sample"]) and scores["chi2_per_sample"] >= 0,
                  f"{path}.chi2_per_sample is {scores['chi2_per_sample']}")
    faults.numbers(scores["nrmse"], STEMS, f"{path}.nrmse", least=0)
    faults.expect(scores["nrmse"], f"{path}.nrmse is empty")


def check_origin(report, faults):
    """Calibration, noise, trials and provenance: a reader judges the numbers by them."""
    faults.expect(set(report["calibration"]) == set(report["calibrated"]),
                  "calibration and calibrated hold other parameters")
    for path, each in report["calibration"].items():
        here = f"calibration.{path}"
        if faults.keys(each, ["value", "ci95", "declared", "declared_sigma", "unit"], here):
            faults.span(each["ci95"], f"{here}.ci95")
            faults.expect(each["value"] == report["calibrated"].get(path), f"{here}.value differs")
            faults.expect(is_text(each["unit"]), f"{here}.unit is {each['unit']}")
    for stem, noise in report["noise"].items():
        here = f"noise.{stem}"
        faults.expect(stem in STEMS, f"{here} is no channel")
        if faults.keys(noise, ["std", "correlation_s", "source"], here):
            faults.numbers({key: noise[key] for key in ("std", "correlation_s")},
                           {"std", "correlation_s"}, here, least=0)
            faults.expect(noise["source"] in ("declared", "estimated", "contradicted"),
                          f"{here}.source is {noise['source']}")
    for i, trial in enumerate(report["tried"]):
        if faults.keys(trial, ["ids", "score_gain", "se"], f"tried[{i}]"):
            faults.expect(trial["ids"] and all(map(is_text, trial["ids"])), f"tried[{i}].ids")
    if faults.keys(report["provenance"], ["version", "seed", "command", "sha256"], "provenance"):
        for name, digest in report["provenance"]["sha256"].items():
            faults.expect(isinstance(digest, str) and len(digest) == 64,
                          f"provenance.sha256.{name} is {digest}")


def faults_of_diagnosis(report):
    """Faults of a report of `stickslip diagnose`."""
    faults = Faults()
    if not faults.keys(report, ["schema", "verdict", "location", "findings", "fit", "calibrated",
                                "calibration", "noise_std", "noise", "tried", "provenance"],
                       "the report"):
        return faults
    faults.expect(report["schema"] == 1, f"schema is {report['schema']}")
    verdict = report["verdict"]
    faults.expect(verdict in VERDICTS, f"verdict is {verdict}")
    check_location(report["location"], verdict, faults)
    findings = report["findings"]
    if faults.expect(isinstance(findings, list), "findings is not a list"):
        faults.expect(verdict != "consistent" or not findings, "consistent with findings")
        faults.expect(verdict != "missing_physics" or findings, "missing_physics without findings")
        for i, finding in enumerate(findings):
            check_finding(finding, f"findings[{i}]", faults)
        named = [(f.get("id"), f.get("channel")) for f in findings if isinstance(f, dict)]
        faults.expect(len(named) == len(set(named)), f"an effect is found twice: {named}")
    if faults.keys(report["fit"], ["heldout", "horizon_s", "windows"], "fit"):
        windows = report["fit"]["windows"]
        if faults.keys(windows, ["fit", "select", "report"], "fit.windows"):
            faults.numbers(windows, {"fit", "select", "report"}, "fit.windows", least=1)
        faults.expect(is_number(report["fit"]["horizon_s"]) and report["fit"]["horizon_s"] > 0,
                      f"fit.horizon_s is {report['fit']['horizon_s']}")
        if faults.keys(report["fit"]["heldout"], ["baseline", "augmented"], "fit.heldout"):
            for side in ("baseline", "augmented"):
                check_scores(report["fit"]["heldout"][side], f"fit.heldout.{side}", faults)
    if faults.expect(isinstance(report["calibrated"], dict), "calibrated is not a table"):
        for path, value in report["calibrated"].items():
            faults.expect("." in path, f"calibrated.{path} is not a path into a model file")
            faults.expect(is_number(value), f"calibrated.{path} is {value}")
    faults.numbers(report["noise_std"], set(COLUMNS.values()), "noise_std", least=0)
    check_origin(report, faults)
    return faults


def faults_of_evaluation(report):
    """Faults of a report of `stickslip evaluate`."""
    faults = Faults()
    if not faults.keys(report, ["schema", "fit", "horizon_s", "free_run"], "the report"):
        return faults
    faults.expect(report["schema"] == 1, f"schema is {report['schema']}")
    check_scores(report["fit"], "fit", faults)
    if faults.keys(report["fit"], ["rmse"], "fit"):
        faults.numbers(report["fit"]["rmse"], set(COLUMNS.values()), "fit.rmse", least=0)
    faults.expect(is_number(report["horizon_s"]) and report["horizon_s"] > 0,
                  f"horizon_s is {report['horizon_s']}")
    if report["free_run"] is not None and faults.keys(report["free_run"], ["rmse", "nrmse"],
                                                      "free_run"):
        faults.numbers(report["free_run"]["rmse"], set(COLUMNS.values()), "free_run.rmse", least=0)
        faults.numbers(report["free_run"]["nrmse"], STEMS, "free_run.nrmse", least=0)
    return faults


def main():
    bad = 0
    for name in sys.argv[1:]:
        with open(name, encoding="utf-8") as file:
            report = json.load(file)
        faults = faults_of_diagnosis(report) if "verdict" in report else faults_of_evaluation(report)
        for fault in faults:
            print(f"{name}: {fault}")
        bad += bool(faults)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
