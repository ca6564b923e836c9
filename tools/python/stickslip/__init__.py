# SPDX-License-Identifier: Apache-2.0
"""Recordings, models and diagnosis of machines with dry friction.

    import stickslip
    report = stickslip.diagnose("run.log", "rig.toml")   # the dictionary of `--json`
    print(report.text)

Everything is in SI units, which the names of columns and parameters end in. A recording is a Recording or
its file, a model a Model or its file. Ctrl-C ends every computation soon, with KeyboardInterrupt; other
threads of Python run meanwhile. `progress(step, share)` is called, by the calling thread, with what is being
done and the completed share of the work, 0 to 1; an exception that it raises ends the computation.

Errors that a person can mend are InputError, a ValueError, with the message of the program.
"""
import collections.abc as _abc
import html as _html
import json as _json
import os as _os

from . import _stickslip
from ._stickslip import Failure, InputError, Live, Model, Parameter, Recording, __version__

__all__ = ["Diagnosis", "Estimates", "Failure", "InputError", "Live", "Model", "Parameter", "Recording",
           "diagnose", "estimate", "evaluate", "simulate", "__version__"]

for _name in ("__contains__", "get", "keys", "items", "values"):
    setattr(Model, _name, getattr(_abc.Mapping, _name))
_abc.Mapping.register(Model)


def _is_file(given):
    return isinstance(given, (str, _os.PathLike))


def _recording(given):
    return Recording.read(given) if _is_file(given) else given


def _model(given):
    return Model.read(given) if _is_file(given) else given


class Diagnosis(dict):
    """The report of a diagnosis: the dictionary that `stickslip diagnose --json` writes (docs/formats.md,
    section 5).

    text: the report as the program prints it
    model: the augmented Model: calibrated, with the physics found and the uncertainty of every fitted number
    html: the report as a page with figures, if that was asked for; otherwise None
    """

    def __init__(self, report, text, html, model):
        super().__init__(report)
        self.text = text
        self.html = html
        self.model = model

    def _repr_html_(self):
        """The report in Jupyter."""
        if self.html is None:
            return f"<pre>{_html.escape(self.text)}</pre>"
        return f'<iframe srcdoc="{_html.escape(self.html)}" width="100%" height="700"></iframe>'


class Estimates(dict):
    """Estimates of the friction state: arrays of shape (estimates,), in SI units, by the names of the columns
    of `stickslip estimate --out`.

    time_s; then each quantity that the model has and its standard deviation, named with _std: displacement_m,
    velocity_m_s, theta, mu, gamma_per_s, normal_load_n, friction_force_n, slip_velocity_m_s; sticking
    (probability, 0 to 1), nis, good (bool).

    summary: the dictionary of `stickslip estimate --json`
    """

    def __init__(self, columns, summary):
        super().__init__(columns)
        self["good"] = self["good"] > 0
        self.summary = summary


def simulate(model, drive, *, seed=1, noise=True, progress=None):
    """The sensor readings of a model under the drive of a recording, as a Recording with its times.

    drive: base_displacement_m [m] or drive_force_n [N], or displacement_m [m] for imposed motion; also
        normal_load_n [N] where the law of the load is "measured"
    seed: of the sensor noise; noise=False leaves it out
    """
    return _stickslip.simulate(_model(model), _recording(drive), seed, noise, progress)


def diagnose(recordings, model, *, seed=1, jobs=0, horizon_s=None, false_alarm_rate=0.01, bootstrap=0, html=False,
             progress=None):
    """Where a model fails to explain recordings of one rig, and which physics it lacks, as a Diagnosis.

    recordings: one, or a list of several
    jobs: threads; 0: one per core. The result does not depend on it.
    horizon_s: length of a prediction [s]; None: from the model
    false_alarm_rate: share of recordings without missing physics in which something may be claimed by chance
    bootstrap: number of synthetic recordings without missing physics that are diagnosed, too
    html: also make the page with figures
    """
    if _is_file(recordings) or isinstance(recordings, Recording):
        recordings = [recordings]
    report, text, page, augmented = _stickslip.diagnose(
        [_recording(each) for each in recordings], _model(model), seed, jobs, horizon_s, false_alarm_rate,
        bootstrap, html, progress)
    return Diagnosis(_json.loads(report), text, page, augmented)


def evaluate(recording, model, *, horizon_s=None, free_run=False, jobs=0, progress=None):
    """The score of a model on a recording, without fitting: the dictionary of `stickslip evaluate --json`.

    horizon_s: length of a prediction [s]; None: from the model
    free_run: also simulate the whole recording from its initial state
    jobs: threads; 0: one per core
    """
    return _json.loads(_stickslip.evaluate(_recording(recording), _model(model), horizon_s, free_run, jobs, progress))


def estimate(recording, model, *, progress=None):
    """Smoothed friction force, friction state, mu, gamma, slip and sticking of a recording, as Estimates."""
    columns, summary = _stickslip.estimate(_recording(recording), _model(model), progress)
    return Estimates(columns, _json.loads(summary))
