# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A trace extends no model while `check` found a clock off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from checked_bags import bag, rig_of
from made_up_traces import pushes, slippery
from mistakes import late
from synthetic import square_rig

from push_predictor.models.push_model import PushModel
from push_predictor.models.train import train_model
from push_predictor.recordings.checks.check import DataChecks
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.write import write_recording
from push_predictor.residuals.channels.measurement import CLOCKS, clock_errors
from push_predictor.residuals.evidence.loading import LoadedData
from push_predictor.residuals.outcome import Trace, trace_json
from push_predictor.residuals.reporting.sentences import answer
from push_predictor.residuals.trace import trace, trace_data

TRIED = ("contact_friction", "pressure_spread")
LATE = Finding("wrench_lag", "warning", "The force is late.", "Synchronise.", {"lag": Value(0.12, "s", 0.002)})


def with_clocks(model: PushModel, clocks: Sequence[Finding], changed: bool) -> Trace:
    table = pushes(60, 2, *([slippery(0.1)] * changed))
    table = replace(table, covariates={"elapsed_time": np.arange(float(len(table)))} | table.covariates)
    loaded = LoadedData(table, None, square_rig())
    return trace(model, loaded, covariates=["elapsed_time"], clocks=clocks)


def test_an_effect_extends_the_model_only_if_the_clocks_are_right(deployed: PushModel) -> None:
    assert with_clocks(deployed, (), True).extended is not None
    off = with_clocks(deployed, (LATE,), True)
    assert (off.verdict, off.extended, off.terms) == ("measurement", None, ())
    assert not trace_json(off)["motion_model_changed"]
    (effect,) = off.effects
    assert effect.mechanism == "clock_offset" and effect.parameter is not None
    assert effect.parameter.low < effect.parameter.value == 0.12 < effect.parameter.high < 0.13
    assert "Synchronise the clocks" in answer(off)[2] and "120" in " ".join(answer(off)).replace("0.12 s", "120 ms")
    assert any("The force is late." in note for note in off.notes) and any(
        "no model is extended" in n for n in off.notes
    )


def test_without_an_effect_a_clock_that_is_off_is_a_note(deployed: PushModel) -> None:
    sound, off = with_clocks(deployed, (), False), with_clocks(deployed, (LATE,), False)
    assert sound.verdict == off.verdict != "measurement"
    assert set(off.notes) - set(sound.notes) and not set(sound.notes) - set(off.notes)


def test_what_the_checks_find_about_clocks_reaches_the_trace(tmp_path: Path) -> None:
    recording, rig, notes = bag("square_abs_test"), rig_of("square_abs_test"), []
    model = train_model(pushes(10, 1), rig, "analytical", name="deployed")
    for given in (recording, late(recording, 0.06)):
        path = tmp_path / f"bag_{len(notes)}"
        write_recording(path, given)
        checks = DataChecks(False, lambda text: None)
        notes.append(trace_data([path], model, rig=rig, covariates=["push_index"], checks=checks).notes)
    assert [any("no model is extended" in note for note in each) for each in notes] == [False, True]


def test_every_finding_about_clocks_has_a_size() -> None:
    every = [replace(LATE, name=name, values={"size": Value(-0.03, "s")}) for name in CLOCKS]
    assert [effect.values for effect in clock_errors(every)] == [(-0.03,)] * len(CLOCKS)
