# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Verdicts on simulated recordings whose measurement is wrong, or only appears to be."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from search_bench import in_library
from sensed_motion import sensed

from push_predictor.errors import RequestError
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.models.train_learnt import MeanChoice
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.residuals.candidates.candidate import Candidate, candidate
from push_predictor.residuals.channels.contrast import NOTHING_FOUND, ChannelEffect, ChannelFinding
from push_predictor.residuals.channels.motion import NO_MOTION, MotionFinding, MotionTerm
from push_predictor.residuals.evidence.input_shift import about_mechanics
from push_predictor.residuals.evidence.loading import LoadedData, cut_again, with_inputs
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.outcome import Sized, Trace, trace_json
from push_predictor.residuals.question import ALPHA_SHARES, Question
from push_predictor.residuals.reporting.notes import _of_data
from push_predictor.residuals.reporting.page import write_trace_report
from push_predictor.residuals.reporting.sentences import answer
from push_predictor.residuals.selection.naming import Naming
from push_predictor.residuals.trace import trace
from push_predictor.simulation.changes import Changes
from push_predictor.simulation.pushes import random_pushes
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.sensors import Faults
from push_predictor.simulation.spec import SimulationSpec

pytestmark = pytest.mark.slow


def spec(seed: int, pushes: int) -> SimulationSpec:
    plan = random_pushes(pushes, (0.02,), travel=0.014, rng=np.random.default_rng(seed))
    return SimulationSpec("rect1", "delrin", plan, seed=seed, surface_seed=1, slider_seed=1, turn_spread=3.0)


SECOND = spec(2, 45)


@cache
def learnt(mean: MeanChoice = "zero", pushes: int = 60, rows: int = 80) -> PushModel:
    recording = simulate(spec(1, pushes))
    assert recording.rig is not None
    table = windows_to_table(find_windows(recording, recording.rig))
    options = TrainingOptions(n_train=rows, mean=mean)
    return train_model(table, recording.rig, "gp", name="deployed", options=options)


@pytest.fixture(autouse=True)
def trained_again_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Several tests trace with the same model beyond its training."""
    monkeypatch.setattr("push_predictor.residuals.question.about_mechanics", retrained)


retrained = cache(about_mechanics)


@pytest.fixture
def a_library_of_four(monkeypatch: pytest.MonkeyPatch) -> None:
    """Computing responses takes most of the time."""
    in_library(monkeypatch, "contact_friction", "pressure_spread", "tilted_surface", "inertia")


def loaded(changes: Changes, faults: Faults, plan: SimulationSpec = SECOND) -> LoadedData:
    new = sensed(plan, faults=faults) if changes == Changes() else simulate(replace(plan, changes=changes))
    assert new.rig is not None
    return LoadedData(cut_again([new], new.rig), (new,), new.rig)


@cache
def faultless() -> LoadedData:
    return loaded(Changes(), Faults())


def traced(changes: Changes = Changes(), **faults: Any) -> Trace:
    """With one covariate: the others cost time and act in no test that uses this."""
    return trace(learnt(), loaded(changes, Faults(**faults)), covariates=["elapsed_time"])


@pytest.mark.usefixtures("a_library_of_four")
def test_second_recording_of_the_same_rig_has_no_effect() -> None:
    assert trace(learnt(), faultless()).verdict == "none"


@pytest.mark.usefixtures("a_library_of_four")
def test_constant_bias_of_the_force_sensor_is_found_in_free_motion_and_changes_nothing_else() -> None:
    found = traced(wrench_bias=(0.5, -0.2, 0.0))
    assert found.verdict == "none" and not trace_json(found)["effect_present"] and found.effects == ()
    assert [e.mechanism for e in found.harmless] == ["wrench_bias"] * 2
    for each, truth in zip(found.harmless, (0.5, -0.2), strict=True):
        assert each.parameter.value == pytest.approx(truth, abs=0.08)  # the sensor's zero is new in each session
    assert any("has a bias of +0." in note and "do not depend on it" in note for note in found.notes)


NOISE = ChannelEffect(None, "velocity", "linear", (), 0.0005, ("dwell_time",), ("dx",))


def found_by_channel(patch: pytest.MonkeyPatch, **findings: Any) -> None:
    """What the channels find: motion, noise, forces and the sensor's zero; nothing if not given."""
    channels = {"motion": "motion_effects", "noise": "_noise", "forces": "wrench_effects", "zero": "zero_shift"}
    for channel, name in channels.items():
        nothing = NO_MOTION if channel == "motion" else NOTHING_FOUND
        finding = findings.get(channel, nothing)
        patch.setattr(f"push_predictor.residuals.channel_search.{name}", lambda *_, found=finding, **__: found)


def test_changed_force_is_the_answer_before_noise_that_seems_to_change_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    lower = Sized("relative change of the force since training", -0.4, -0.42, -0.38, "1")
    effect = ChannelEffect("surface_friction", "model_inputs", "constant", (lower,), 0.0005, ())
    found_by_channel(monkeypatch, noise=ChannelFinding((NOISE,)))
    alone = trace(learnt(), faultless())
    assert (alone.verdict, alone.kind, alone.equivalent) == ("variance", "variance", ("dwell_time",))
    found_by_channel(monkeypatch, noise=ChannelFinding((NOISE,)), forces=ChannelFinding((effect,)))
    both = trace(learnt(), faultless())
    assert (both.verdict, both.kind, both.equivalent) == ("wrench_only", None, ())
    assert [(e.mechanism, e.p_value) for e in both.effects] == [("surface_friction", 0.0005 / ALPHA_SHARES["force"])]
    assert any("noise of the motion changed as well" in note and "speed" in note for note in both.notes)


def test_effect_that_only_resembles_a_mechanism_has_no_size_and_its_rest_is_no_second_effect(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The model takes the mechanism's response and what this leaves; the trace reports one unknown effect."""

    def unnamed(_: PushModel, evidence: Evidence, *__: Any, **___: Any) -> MotionFinding:
        time = evidence.table.covariates["elapsed_time"]
        drift = DriverBasis("linear", ("elapsed_time",), (float(time.mean()),), (float(time.std()),))
        turning = DriverBasis("periodic", ("slider_heading",))
        slope = candidate(evidence, "tilted_surface", "elapsed_time", drift)
        rest = candidate(evidence, None, "slider_heading", turning)
        terms = (_term(slope, resembles="tilted_surface"), _term(rest, resembles=None))
        return replace(NO_MOTION, terms=terms)

    found_by_channel(monkeypatch)
    monkeypatch.setattr("push_predictor.residuals.channel_search.motion_effects", unnamed)
    found = trace(learnt(), faultless())
    assert (found.verdict, found.mechanisms) == ("driver_only", ())
    (effect,) = found.effects
    assert (effect.mechanism, effect.resembles, effect.parameter) == (None, "tilted_surface", None)
    assert effect.p_value == 0.001 / ALPHA_SHARES["motion"] and sum(ALPHA_SHARES.values()) == pytest.approx(1.0)
    assert [term.mechanism for term in found.terms] == ["tilted_surface", None]
    json.dumps(trace_json(found))
    write_trace_report(tmp_path / "page.html", found)  # pairs effects with terms
    assert "further" not in " ".join(answer(found))


def _term(best: Candidate, resembles: str | None) -> MotionTerm:
    """A term without a name."""
    naming = Naming((best.covariate,), (None,), False, resembles)
    return MotionTerm(best, 0.001, 100.0, naming, ("dx", "dy"), 0.1, False, False, resembles is None)


def test_force_is_judged_only_where_training_shows_what_it_should_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pushes faster than those of training need another force on an unchanged rig."""
    data, judged = faultless(), []
    inputs = data.table.inputs.copy()
    faster = np.isin(data.table.push_id, data.table.pushes[::2])
    inputs[faster, 0] *= 5.0
    shifted = replace(data, table=replace(data.table, inputs=inputs).take(inputs[:, 1] < 0.35), recordings=None)
    assert Question.of(learnt(), shifted).model is retrained(learnt())
    found_by_channel(monkeypatch)
    searched = "push_predictor.residuals.channel_search.wrench_effects"
    monkeypatch.setattr(searched, lambda table, *_: judged.append(table) or NOTHING_FOUND)
    found = trace(learnt(), shifted)
    assert [(each.covariate, each.extrapolates) for each in found.input_shift] == [
        ("velocity", True),
        ("contact", False),
    ]
    assert any("Not tested" in note for note in found.notes)
    assert 0 < len(judged[0]) < len(found.analysis)
    assert judged[0].inputs[:, 0].max() < 2.0 * data.table.inputs[:, 0].max()


def test_pushes_on_one_side_are_a_shift_without_extrapolation(monkeypatch: pytest.MonkeyPatch) -> None:
    """The model was trained there, too. About the other sides the new pushes show nothing."""
    data = faultless()
    one_side = replace(data, table=data.table.take(data.table.inputs[:, 1] < 0.35), recordings=None)
    found_by_channel(monkeypatch)
    found = trace(learnt(), one_side)
    assert [each.covariate for each in found.input_shift] == ["contact"]
    assert found.verdict == "input_shift" and found.extended is None
    assert not any("Not tested" in note for note in found.notes)
    assert answer(found)[2].startswith("Keep the deployed model, and push in the rest of its range")


@pytest.mark.parametrize(
    ("moved", "words"), [(0.0, "do not depend on it"), (1e-3, "Zero the sensor, and record again")]
)
def test_zero_of_the_sensor_is_only_noted_next_to_another_change(
    monkeypatch: pytest.MonkeyPatch, moved: float, words: str
) -> None:
    found_by_channel(monkeypatch, zero=pulled(), noise=ChannelFinding((NOISE,)))
    monkeypatch.setattr("push_predictor.residuals.channel_search.cut_again", turned(moved))
    traced = trace(learnt(), faultless())
    assert traced.verdict == "variance"
    assert any("+0.5 N along x" in note and words in note for note in traced.notes)


@pytest.mark.parametrize(
    ("moved", "share", "verdict"),
    [(0.0, 1.0, "none"), (1e-3, 1.0, "measurement"), (1e-9, 0.01, "none"), (1e-9, 0.05, "measurement")],
)
def test_force_bias_is_a_measurement_error_if_its_correction_changes_two_per_cent_of_the_windows(
    monkeypatch: pytest.MonkeyPatch, moved: float, share: float, verdict: str
) -> None:
    """moved: by what the correction of the force would change the inputs of this share of the windows, rad."""
    found_by_channel(monkeypatch, zero=pulled())
    monkeypatch.setattr("push_predictor.residuals.channel_search.cut_again", turned(moved, share))
    result = trace_json(trace(learnt(), faultless()))
    harmful = verdict == "measurement"
    assert (result["verdict"], result["channel"], result["motion_model_changed"]) == (verdict, verdict, False)
    assert [effect["mechanism"] for effect in result["effects"]] == ["wrench_bias"] * 2 * harmful
    assert [each["mechanism"] for each in result["harmless"]] == ["wrench_bias"] * 2 * (not harmful)


def test_force_bias_of_a_push_table_is_harmless_for_nothing_can_be_corrected(monkeypatch: pytest.MonkeyPatch) -> None:
    found_by_channel(monkeypatch, zero=pulled())
    found = trace(learnt(), replace(faultless(), recordings=None))
    assert found.verdict == "none" and len(found.harmless) == 2


def pulled() -> ChannelFinding:
    """A bias of the force sensor."""
    pulls = tuple(Sized(f"force read too much along {axis}", 0.5, 0.4, 0.6, "N") for axis in "xy")
    return ChannelFinding((ChannelEffect("wrench_bias", "model_inputs", "constant", pulls, 0.0005),))


def turned(angle: float, share: float = 1.0) -> Callable[..., PushTable]:
    """Cuts the faultless windows again, of which this share has an angle larger by `angle`."""

    def cut(*_: Any) -> PushTable:
        table = faultless().table
        inputs = table.inputs.copy()
        inputs[: round(share * len(inputs)), 2] += angle
        return replace(table, inputs=inputs)

    return cut


@pytest.mark.usefixtures("a_library_of_four")
def test_late_clock_is_corrected() -> None:
    found = traced(clock_offset=0.03)
    assert found.verdict == "measurement" and found.effects[0].mechanism == "clock_offset"
    assert found.effects[0].parameter is not None
    assert found.effects[0].parameter.value == pytest.approx(0.03, abs=0.006)


@pytest.mark.usefixtures("a_library_of_four")
def test_compliant_tip_is_not_reported_as_a_late_clock() -> None:
    """It opens the gap like a late clock, but correcting the clock does not improve the predictions."""
    found = traced(compliance=5e-3)
    assert found.verdict not in ("none", "measurement")


@pytest.mark.usefixtures("a_library_of_four")
def test_effect_in_the_models_own_inputs_is_reported_and_left_to_a_refit() -> None:
    """Lower contact friction changes every window, and the same model learns it when retrained."""
    found = traced(changes=Changes(contact_friction=lambda moment: np.full(len(moment.travelled), -0.2)))
    result = trace_json(found)
    assert (result["verdict"], result["kind"], result["covariates"][0]) == ("effect", "mean", "session")
    assert not result["motion_model_changed"] and found.extended is None
    assert result["gain"]["nlpd"] == {"value": 0.0, "low": 0.0, "high": 0.0}
    refit, before = (sum(result[model]["nlpd"].values()) for model in ("refit", "before"))
    assert refit < before
    assert answer(found)[2].startswith("Retrain the model on the new pushes: that is enough")


def test_a_covariate_that_varies_along_a_push_is_rejected_by_name() -> None:
    with pytest.raises(RequestError, match=r"contact_gap.*give one of .*elapsed_time"):
        Question.of(learnt(), faultless(), covariates=["contact_gap"])
    for alpha in (0.0, 1.0):
        with pytest.raises(RequestError, match=f"alpha: {alpha}"):
            Question.of(learnt(), faultless(), alpha=alpha)


@pytest.mark.usefixtures("a_library_of_four")
def test_faster_pushes_than_those_of_training_are_a_shift_of_the_inputs() -> None:
    plan = random_pushes(30, (0.06,), travel=0.02, rng=np.random.default_rng(5))
    fast = simulate(replace(spec(2, len(plan)), pushes=plan))
    assert fast.rig is not None
    result = trace_json(trace(learnt(), LoadedData(cut_again([fast], fast.rig), (fast,), fast.rig)))
    (shift,) = result["input_shift"]
    assert (result["verdict"], shift["covariate"], shift["share_outside"]) == ("input_shift", "velocity", 1.0)
    assert shift["training"] == pytest.approx([0.02, 0.02], rel=0.1)
    assert shift["now"] == pytest.approx([0.06, 0.06], rel=0.1)
    assert not result["motion_model_changed"]
    assert any("some pushes lie outside the inputs of training: constant effects" in note for note in result["notes"])
    assert "velocity" not in {tested["covariate"] for tested in result["tested"]}


@pytest.mark.long
def test_a_large_effect_on_an_informed_model_is_one_change_of_its_mechanics() -> None:
    """Contact friction falls by 0.2. The refit keeps the mechanics, so that the effect is added to them."""
    slippery = Changes(contact_friction=lambda moment: np.full(len(moment.travelled), -0.2))
    found = trace(learnt("mechanics", 80, 150), loaded(slippery, Faults(), spec(2, 60)), covariates=["elapsed_time"])
    (effect,) = found.effects
    assert (found.verdict, effect.mechanism, effect.covariate) == ("effect", "contact_friction", "session")
    assert effect.parameter is not None and effect.parameter.low < -0.2 < effect.parameter.high < -0.1
    assert found.terms[0].exact and found.gain_nlpd.value < 0.0


def test_pushes_that_the_model_was_trained_on_are_not_judged() -> None:
    """A model fits these better than others: next to later ones that looks like a change between the recordings."""
    model, later = learnt(), faultless()
    both = replace(later, table=concatenate([later.table, with_inputs(model.training)]), recordings=None)
    question = Question.of(model, both)
    assert question.trained == len(model.training.pushes)
    assert not {*question.windows.pushes, *question.held_out.pushes} & {*model.training.pushes}
    assert f"trained on {question.trained} of the pushes" in " ".join(_of_data(question))
    textbook = train_model(model.training, model.rig, "analytical", name="textbook")
    assert Question.of(textbook, both).trained == 0  # its mean was fitted to none
    with pytest.raises(RequestError, match=r"pushes: 0 .*that a learned model was not trained on"):
        Question.of(model, replace(both, table=with_inputs(model.training)))


def test_pushes_at_the_same_time_of_a_clock_without_dates_are_other_pushes() -> None:
    model, later = learnt(), faultless()
    again = replace(model.training, outcomes=1.5 * model.training.outcomes)
    names = np.char.replace(again.push_id, "push-15", "push-00")
    data = replace(later, table=with_inputs(replace(again, push_id=names)), recordings=None)
    known = replace(model, training=replace(model.training, push_id=names))
    assert Question.of(known, data).trained == 0
