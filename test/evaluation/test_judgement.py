# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The sentence that says whether a model fits a recording, and the scores and sentences of a ladder."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic import square_rig

from push_predictor.evaluation.judgement import judged
from push_predictor.evaluation.ladder_page import ladder_answer, ladder_json, write_ladder_page
from push_predictor.evaluation.report.summary import opening_sentences
from push_predictor.evaluation.scored_ladder import ScoredLadder, changed, score_ladder
from push_predictor.models.mechanics.fit import FitRows, JointFit
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.ladder import Change, Rung
from push_predictor.models.predictors import MechanicsPredictor
from push_predictor.models.push_model import Provenance, PushModel
from push_predictor.recordings.table import PushTable

ALARM: dict[str, Any] = {"fired": False}


def metrics(share: float, pushes: int = 100, nmse: float | None = 0.2, **alarm: object) -> dict[str, Any]:
    """Metrics of a recording with this share of the outcomes inside 95 % intervals."""
    coverage = {"0.95": {"dx": share - 0.01, "dy": share, "dtheta": share + 0.01}}
    return {"n_train": 60, "n_pushes": pushes, "coverage": coverage, "nmse": {"total": nmse}, "alarm": ALARM | alarm}


@pytest.mark.parametrize(
    ("used", "label"), [(0, "fits"), (49, "fits"), (50, "fits its training"), (100, "fits its training")]
)
def test_a_fit_to_training_pushes_is_named_as_such(used: int, label: str) -> None:
    found = judged({**metrics(0.95), "n_training_pushes": used})
    assert found.label == label
    assert ("not used for training" in found.action) == (used >= 50)
    assert judged({**metrics(0.5), "n_training_pushes": used}).label == "too sure"


@pytest.mark.parametrize(
    ("found", "label"),
    [
        (metrics(0.93), "fits"),
        (metrics(0.9, pushes=25), "fits"),
        (metrics(0.9, pushes=400), "too sure"),
        (metrics(0.93, nmse=None), "fits"),
        (metrics(0.93, fired=True), "no longer fits"),
        (metrics(0.5, fired=True), "no longer fits"),
        (metrics(0.85), "too sure"),
        (metrics(0.93, nmse=3.0), "no better than the mean"),
        (metrics(0.93, pushes=9), "too few pushes"),
        (metrics(0.93, pushes=10), "fits"),
        (metrics(0.3, pushes=9), "too sure"),
        (metrics(0.93, pushes=9, fired=True), "no longer fits"),
        (metrics(0.93, pushes=9, off="few"), "too few pushes"),
        (metrics(0.93, off="few"), "no objection"),
        (metrics(0.5, off="few"), "too sure"),
    ],
)
def test_coverage_error_and_alarm_decide_the_label(found: dict[str, Any], label: str) -> None:
    assert judged(found).label == label


@pytest.mark.parametrize(
    ("low", "pushes", "label"),
    [(0.01, 100, "worse than physics"), (-0.01, 100, "fits"), (None, 100, "fits"), (0.01, 9, "too few pushes")],
)
def test_a_model_worse_than_textbook_physics_does_not_fit_whatever_its_coverage(
    low: float | None, pushes: int, label: str
) -> None:
    textbook = {"nmse": {"total": 0.5}, "difference": {"value": 0.16, "low": low, "high": 0.3}}
    found = judged({**metrics(0.95, pushes, 0.66), "textbook": textbook, "n_training_pushes": pushes - 1})
    assert found.label == ("fits its training" if label == "fits" else label)
    assert ("is 0.66, that of physics 0.5" in found.sentence) == (label == "worse than physics")
    assert len(found.sentence.split()) <= 25


@pytest.mark.parametrize(
    "found",
    [
        metrics(share, pushes, nmse, **alarm)
        for share in (0.3, 0.93)
        for pushes in (1, 9, 100)
        for nmse in (0.2, 3.0)
        for alarm in ({}, {"fired": True}, {"off": "few"})
    ],
)
def test_opening_has_three_plain_sentences(found: dict[str, Any]) -> None:
    interval = {"nmse": {"low": 0.1, "high": 0.3}}
    for sentence in opening_sentences({**found, "interval": interval}):
        assert sentence.endswith(".") and len(sentence.replace(" %", "%").split()) <= 25, sentence


def test_opening_gives_the_error_with_its_interval() -> None:
    found = {**metrics(0.93), "interval": {"nmse": {"low": 0.1, "high": 0.3}}}
    assert opening_sentences(found)[1].startswith("Its squared error (total NMSE) is 0.200 (95 % CI 0.100 to 0.300)")
    assert "CI" not in opening_sentences({**found, "interval": {"nmse": None}})[1]
    assert "has no scale" in opening_sentences({**found, "nmse": {"total": None}})[1]


# --- ladder -----------------------------------------------------------------------------------------------------------


NOISE = np.array([1e-4, 1e-4, 1e-3])


def made_up_ladder(windows_per_push: int = 4) -> ScoredLadder:
    """A linear world: outcomes follow one parameter, 0.2 m per unit along dy; ten pushes of four windows."""
    rng, n = np.random.default_rng(0), 40
    slope = np.zeros((n, 3, 1))
    slope[:, 1, 0] = 0.02 * rng.standard_normal(n)
    noise = NOISE * rng.standard_normal((n, 3))
    moved = 0.1 * slope[:, :, 0]
    inputs = np.column_stack([np.full(n, 0.02), rng.random(n), np.zeros(n)])
    rows = FitRows(inputs, np.full(n, 0.2), moved + noise, np.arange(n) // windows_per_push)
    textbook = JointFit(rows, (), {}, moved + noise, NOISE, np.zeros((n, 3, 0)))
    fitted = JointFit(rows, ("body_anisotropy",), {"body_anisotropy": 0.1}, noise, NOISE, slope)
    rival = Change(("centre_x",), (), 3.0)
    ladder = [Rung(textbook), Rung(fitted, ("body_anisotropy",), (), 60.0, 5.0, (rival,))]
    rig = square_rig()
    mechanics = FittedMechanics(PushMechanics(rig.outline, rig.pusher_radius), fitted.values, fitted.covariance)
    table = PushTable(inputs, rows.duration, rows.outcomes, rows.push.astype(str))
    predictor = MechanicsPredictor(mechanics, np.diag(NOISE**2))
    return score_ladder(PushModel("m", "analytical", rig, predictor, table, Provenance((), 10, 0, "0")), ladder)


@pytest.fixture(scope="module")
def ladder() -> ScoredLadder:
    return made_up_ladder()


def test_held_out_scores_are_those_of_the_noise_once_the_parameter_is_free(ladder: ScoredLadder) -> None:
    textbook, fitted = ladder.steps
    # dy of the textbook is unexplained, as by the mean; dx and dtheta are pure noise in both steps.
    assert textbook.nmse.value == pytest.approx(3.0, rel=0.1) and fitted.nmse.value == pytest.approx(2.0, rel=0.1)
    expected = np.log(NOISE * np.sqrt(2.0 * np.pi * np.e)).sum()
    assert fitted.nlpd.value == pytest.approx(expected, abs=0.4)
    assert textbook.nlpd.low > fitted.nlpd.high


def test_single_push_gives_finite_scores() -> None:
    step = made_up_ladder(windows_per_push=40).steps[0]
    assert np.isfinite([step.nmse.value, step.nlpd.value]).all()


def test_gain_is_per_push(ladder: ScoredLadder) -> None:
    gain = ladder.steps[1].gain
    assert ladder.steps[0].gain is None and gain is not None
    assert [gain.value, gain.low, gain.high] == pytest.approx([6.0, 6.0 - 0.98, 6.0 + 0.98])


def test_answer_of_few_pushes_asks_for_more() -> None:
    few = made_up_ladder(windows_per_push=5)
    assert ladder_answer(few)[2] == "Only 8 pushes are behind the choice. Record at least 10 and fit again."


def test_answer_of_a_ladder_without_a_step_is_the_textbook(ladder: ScoredLadder) -> None:
    gain, evidence, action = ladder_answer(replace(ladder, steps=ladder.steps[:1], final=[]))
    assert gain.startswith("The textbook values suffice") and action.startswith("Use this model.")
    assert evidence.startswith("Their NMSE is 3.") and "falls" not in evidence


def test_json_has_what_the_reference_lists(ladder: ScoredLadder) -> None:
    found = json.loads(json.dumps(ladder_json(ladder), allow_nan=False))
    assert set(found) == {"model", "search", "fit", "steps", "parameters"}
    assert found["search"] == {"windows": 40, "pushes": 10}
    step = found["steps"][1]
    assert step["added"] == ["body_anisotropy"] and step["dropped"] == [] and step["rivals"] == ["centre_x"]
    assert step["held_out"]["nmse"]["low"] < step["held_out"]["nmse"]["value"] < step["held_out"]["nmse"]["high"]
    assert found["parameters"][0]["name"] == "body_anisotropy" and found["parameters"][0]["unit"] == "1"


def test_changes_are_written_in_words() -> None:
    assert changed((), ()) == "textbook"
    assert changed(("a", "b"), ("c",)) == "a and b in place of c"
    assert changed((), ("c",)) == "without c"


@pytest.mark.slow
def test_page_is_self_contained_and_answers_first(ladder: ScoredLadder, tmp_path: Path) -> None:
    text = write_ladder_page(tmp_path / "m.ladder.html", ladder).read_text()
    assert "1 fitted parameter reduces the squared error of held-out pushes by" in text
    assert text.index("fitted parameter reduces") < text.index("<svg") < text.index("<h2")
    assert "<svg" in text and "http" not in text
    assert not list(tmp_path.glob("*.png"))
