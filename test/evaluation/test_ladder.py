# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ladder of fitted mechanics as readers see it: scores of its steps, text, JSON and the page."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import square_rig

from push_predictor.evaluation.ladder_page import ladder_answer, ladder_json, write_ladder_page
from push_predictor.evaluation.scored_ladder import ScoredLadder, changed, score_ladder
from push_predictor.models.mechanics.fit import FitRows, JointFit
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.ladder import Change, Rung
from push_predictor.models.predictors import MechanicsPredictor
from push_predictor.models.push_model import Provenance, PushModel
from push_predictor.recordings.table import PushTable

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
