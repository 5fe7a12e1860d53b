# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The quasi-static study: pushes of equal travel, models without the speed as an input, where they turn."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import paper_studies
import pytest
from push_predictor_paper.data.time_scaled import (
    TRAVEL,
    Bracket,
    equal_travel,
    fold_of,
    number_of,
    score_bracket,
    speed_windows,
    training_rows,
)
from push_predictor_paper.plan import Plan
from push_predictor_paper.section import TooFewError
from push_predictor_paper.sections.quasi_static import (
    MAIN,
    SERIES,
    Brackets,
    beyond,
    course,
    departure,
    estimated,
    section,
    turn,
    turn_of,
)

from push_predictor.evaluation.estimate import Estimate, total_nmse
from push_predictor.evaluation.push_scores import PushScores
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

SPEEDS = (0.01, 0.02, 0.05, 0.075, 0.2)
FEW: Plan = replace(paper_studies.PLAN, speeds=(0.05, 0.075, 0.1), speed_pushes=16)
RIG = paper_studies.rig_of("rect1", "plywood")


def windows_at(number: int, inertia: float) -> PushTable:
    """Windows of 5 mm at a speed whose turn falls short by a share that grows with the speed."""
    speed, pushes, rng = SPEEDS[number], 40, np.random.default_rng([0, number])
    contact, angle = rng.random(pushes), rng.uniform(-1.4, 1.4, pushes)
    turn = (1.0 - inertia * speed / SPEEDS[-1]) * np.sin(8.0 * np.pi * contact)
    outcomes = np.column_stack([TRAVEL * np.cos(angle), TRAVEL * np.sin(angle), 0.1 * turn])
    outcomes += [1e-4, 1e-4, 0.005] * rng.standard_normal((pushes, 3))
    names = np.array([f"{number:02d}-{k:05d}" for k in range(pushes)])
    inputs = np.column_stack([np.full(pushes, speed), contact, angle])
    return PushTable(inputs, np.full(pushes, TRAVEL / speed), outcomes, names)


def scores_of(error: dict[int, float], pushes: int = 40) -> PushScores:
    """Pushes of several speeds (numbers) with squared errors about these, in units of their spread, summed over 3."""
    names = np.array([f"{number:02d}-{k:05d}" for number in error for k in range(pushes)])
    rng = np.random.default_rng(0)
    scale = np.repeat(list(error.values()), pushes)[:, None] / 3.0
    ones = np.ones((len(names), 3))
    return PushScores(
        names, ones[:, 0], scale * rng.uniform(0.8, 1.2, ones.shape), ones, ones, ones, np.ones((len(names), 3, 3))
    )


def judged_from(errors: list[dict[int, float]]) -> Brackets:
    """Brackets of these errors by speed."""
    scores = [scores_of(error) for error in errors]
    return Brackets(SPEEDS, tuple(range(5)), 50, 200, dict.fromkeys(SERIES, scores))


def flat(level: float) -> dict[int, float]:
    """The same error at every speed."""
    return dict.fromkeys(range(5), level)


# --- pushes ---------------------------------------------------------------------------------------------------------


def test_the_same_push_twice_as_fast_has_the_same_outcome_when_slow_and_not_when_fast() -> None:
    """The simulator's own truth: inertia is nothing at 20 mm/s and something at 200 mm/s."""
    plan = replace(FEW, speeds=(0.01, 0.02, 0.2), speed_pushes=6)
    slowest, slow, fast = (equal_travel(plan, "rect1", "plywood", k) for k in range(3))
    assert slowest.shape == (6, 3)
    assert departure(slowest, slow).value < 0.01
    assert departure(slowest, fast).value > 0.03


@pytest.mark.slow
def test_windows_are_of_equal_travel_at_every_speed() -> None:
    """Four of 5 mm a push at most; no push is made at two speeds."""
    tables = [speed_windows(replace(FEW, speed_pushes=6), "rect1", "plywood", k) for k in range(2)]
    for k, table in enumerate(tables):
        assert table.inputs[:, 0] * table.duration == pytest.approx(TRAVEL)
        assert np.unique(table.push_id, return_counts=True)[1].max() <= 4
        assert {number_of(name)[0] for name in table.push_id.tolist()} == {k}
        assert np.hypot(*table.outcomes[:, :2].T).max() < 1.5 * TRAVEL
    first, second = ({round(c, 6) for c in table.inputs[:, 1].tolist()} for table in tables)
    assert not first & second


def test_departure_is_in_units_of_the_slowest_outcomes_variance() -> None:
    """Outcomes that all miss by half an sd in one output depart by a quarter."""
    rng = np.random.default_rng(0)
    outcomes = rng.standard_normal((200, 3))
    shifted = outcomes + [0.5 * outcomes[:, 0].std(), 0.0, 0.0]
    assert departure(outcomes, shifted).value == pytest.approx(0.25)
    shifted[:100] = outcomes[:100]
    half = departure(outcomes, shifted)
    assert half.value == pytest.approx(0.125) and half.low < 0.125 < half.high


# --- models ---------------------------------------------------------------------------------------------------------


def test_held_out_fold_is_not_in_the_training_rows() -> None:
    """Push k of any speed belongs to one fold; fewer rows lie within more."""
    table = windows_at(1, 0.0)
    some, more = (training_rows(table, Bracket("gp", 1, n, False, 2)) for n in (10, 20))
    assert set(some) < set(more)
    assert 2 not in fold_of(table)[more]
    judged = score_bracket([windows_at(k, 0.0) for k in range(2)], RIG, Bracket("gp", 1, 20, False, 2))
    assert {number_of(name)[1] % 5 for name in judged.push_id.tolist()} == {2}
    assert {number_of(name)[0] for name in judged.push_id.tolist()} == {0, 1}


def nmse_at(inertia: float, with_speed: bool, speeds: int, at: int) -> float:
    """NMSE at one speed of a GP of pushes of the slowest speeds."""
    windows = [windows_at(k, inertia) for k in range(5)]
    found = score_bracket(windows, RIG, Bracket("gp", speeds, 32, with_speed, 0))
    return float(
        total_nmse(found.totals(np.array([[number_of(name)[0] == at for name in found.push_id.tolist()]], float)))[0]
    )


def test_a_model_of_slow_pushes_knows_fast_ones_only_where_the_world_is_quasi_static() -> None:
    """Trained at 10 mm/s, judged at 200 mm/s after scaling: all is known, or the turn has the wrong sign."""
    assert nmse_at(0.0, False, 1, 4) < 0.05
    assert nmse_at(2.0, False, 1, 4) > 1.0


@pytest.mark.slow
def test_speed_as_an_input_helps_where_inertia_matters() -> None:
    """The turn reverses with speed: without the speed it cannot be predicted."""
    assert nmse_at(2.0, True, 5, 4) < 0.5 * nmse_at(2.0, False, 5, 4)


# --- verdicts -------------------------------------------------------------------------------------------------------


def test_each_bracket_is_scored_on_its_own_speeds_the_slow_ones_or_one() -> None:
    """Errors that differ by speed show which pushes were counted."""
    judged = judged_from([{0: 0.1, 1: 0.3, 2: 0.5, 3: 0.7, 4: 0.9}] * 5)
    assert judged.same(MAIN)[:, 0] == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5], rel=0.05)
    assert judged.slow(MAIN)[:, 0] == pytest.approx([0.2] * 5, rel=0.05)


@pytest.mark.parametrize(
    ("levels", "verdict", "place"),
    [
        ((0.6, 0.5, 0.4, 0.3, 0.5), "holds", "holds"),
        ((0.6, 0.5, 0.4, 0.3, 0.2), "holds in part", "does not hold"),
        ((0.2, 0.3, 0.4, 0.5, 0.6), "holds in part", "does not hold"),
        ((0.2, 0.3, 0.4, 0.5, 0.3), "does not hold", "does not hold"),
        ((0.3, 0.3, 0.3, 0.3, 0.3), "not decided", None),
    ],
)
def test_the_verdict_follows_the_curve(levels: tuple[float, ...], verdict: str, place: str | None) -> None:
    """A valley at the paper's turn, a fall, a rise, a hill, nothing."""
    judged = judged_from([flat(level) for level in levels])
    assert paper_studies.verdict_on("quasi_static", "course", course(judged)) == verdict
    if place is not None:
        assert paper_studies.verdict_on("quasi_static", "turn", turn(judged)) == place


def test_the_interval_of_the_turn_is_that_of_the_draws_own_turns() -> None:
    curves = np.array([[0.3, 0.3, 0.3, 0.3], [0.2, 0.1, 0.2, 0.3], [0.1, 0.2, 0.1, 0.1]])
    found = turn_of((0.02, 0.03, 0.06), curves)
    assert found.value == 0.06 and found.low < 0.05 < found.high


def test_a_departure_is_notable_from_a_tenth_of_the_error_on() -> None:
    """Of the model's error, 0.3 here; the least at high speed counts, and the largest at low speed."""
    departures = {
        0.02: Estimate(0.005, 0.001, 0.006),
        0.05: Estimate(0.01, 0.009, 0.02),
        0.1: Estimate(0.2, 0.1, 0.3),
        0.2: Estimate(0.4, 0.3, 0.5),
    }
    evidence = beyond(departures, 0.3)
    assert paper_studies.verdict_on("quasi_static", "beyond", evidence) == "holds"
    assert [f.estimate.value for f in evidence.figures] == pytest.approx([0.2 / 0.3, 0.01 / 0.3])
    departures[0.05] = Estimate(0.05, 0.04, 0.06)
    assert paper_studies.verdict_on("quasi_static", "beyond", beyond(departures, 0.3)) == "holds in part"
    assert beyond({0.05: departures[0.05]}, 0.3).figures == beyond(departures, np.nan).figures == ()


def test_skips_draws_without_any_such_push() -> None:
    """Few pushes: a draw may hold none of a speed."""
    draws: Array = np.array([0.3, 0.2, np.nan, 0.4])
    assert estimated(draws).high < 0.41
    assert np.isnan(estimated(np.full(4, np.nan)).low)


@pytest.mark.slow
def test_too_few_windows_are_not_decided(tmp_path: Path) -> None:
    """Three pushes a speed are nothing to learn from."""
    plan = replace(FEW, speeds=(0.075, 0.1), speed_pushes=3)
    with pytest.raises(TooFewError, match="Fewer than two speeds"):
        section(replace(paper_studies.made_up_study(tmp_path), plan=plan))
