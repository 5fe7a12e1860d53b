# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The benchmarks of adaptation and of the alarm on made-up scores: gains, shares, targets; what is false or late."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from benchmarks.adaptation.methods import Scored, Tuesday
from benchmarks.adaptation.rigs import NOTHING, WEAR
from benchmarks.adaptation.tables import Record, rows, verdict
from benchmarks.blind.alarm import Row
from push_predictor.evaluation.push_scores import PushScores
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.loading import LoadedData

PUSHES = tuple(f"push-{k}" for k in range(140))  # in order of time, which is not that of their names


def scored(nlpd: float, covered: float = 0.95) -> Scored:
    """Scores of pushes of two windows; of the first 30 while they are seen, the k-th is worse by 0.1 k."""

    def scores(pushes: tuple[str, ...], worse: np.ndarray) -> PushScores:
        ones = np.ones((len(pushes), 3))
        sums = 2.0 * (nlpd + worse)[:, None] * ones / 3.0
        inside = np.repeat(2.0 * covered * ones[:, :, None], 3, axis=2)
        return PushScores(np.array(pushes), 2.0 * ones[:, 0], ones, 2.0 * ones, sums, sums, inside)

    running = sorted(range(30), key=lambda k: PUSHES[k])
    first = scores(tuple(PUSHES[k] for k in running), 0.1 * np.array(running))
    return Scored({k: scores(PUSHES[100:], np.zeros(40)) for k in (0, 10, 30)}, first)


def record(change: str, adapted: float, oracle: float = -2.8, rig: str = "own_1", covered: float = 0.95) -> Record:
    """Scores next to a deployed model with an NLPD of -2."""
    methods = {"deployed": scored(-2.0), "oracle": scored(oracle), "adapted": scored(adapted, covered)}
    return Record(rig, change, PUSHES, methods)


def row(records: list[Record], table: str, pushes: int) -> dict[str, Any]:
    return next(r for r in rows(records) if (r["table"], r["pushes"], r["level"]) == (table, pushes, "all"))


def test_gains_are_pooled_and_shares_are_those_of_the_oracles() -> None:
    found = row([record("tilt", -2.8), record("tilt", -2.4, rig="points_1")], "after", 10)
    assert found["gain"]["adapted"]["value"] == pytest.approx(0.6) and found["recordings"] == 2
    assert found["gain"]["adapted"]["low"] < 0.6 < found["gain"]["adapted"]["high"]
    assert found["share"]["adapted"]["value"] == pytest.approx(0.75) and found["nmse"]["adapted"] == pytest.approx(1.5)
    assert row([record("tilt", -2.8, oracle=-2.09)], "after", 10)["share"]["adapted"]["value"] is None


def test_the_next_pushes_are_the_first_in_time() -> None:
    assert row([record("tilt", -2.6)], "next", 10)["nlpd"]["adapted"] == pytest.approx(-2.6 + 0.45)


def test_targets_name_what_misses_them() -> None:
    lines = list(verdict(rows([record("tilt", -2.6), record(NOTHING, -1.97, oracle=-3.0, covered=0.92)]), "adapted"))
    assert "all: 0.5 of the oracle's gain after 10 pushes: 1 of 2; not all nothing after 10 (-0.030)" in lines[0]
    assert "0.8 of the oracle's gain after 30 pushes: 0 of 2; not all tilt after 30 (0.750)" in lines[1]
    assert "0 of 5; not all nothing after 0 (-0.030), all nothing after 10 (-0.030), all nothing next" in lines[2]
    assert "2 of 4; not all nothing after 10 (0.920), all nothing after 30 (0.920)" in lines[3]


@pytest.mark.parametrize(("change", "tested"), [("tilt", range(100, 140)), (WEAR, range(30, 50))])
def test_models_are_judged_on_pushes_that_none_has_seen(change: str, tested: range) -> None:
    columns = np.ones((140, 3))
    table = PushTable(columns, columns[:, 0], columns, np.array(PUSHES))
    tuesday = Tuesday(cast(PushModel, None), change, LoadedData(table, None, cast(Rig, None)))
    assert tuesday.tested(30).pushes == [PUSHES[k] for k in tested]


# --- the table of the alarm's benchmark -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "fired", "false", "delay"),
    [
        (None, None, False, None),
        (None, 7, True, None),
        (100, None, False, None),
        (100, 90, True, None),
        (100, 100, True, None),
        (100, 101, False, 1),
        (100, 130, False, 30),
    ],
)
def test_alarm_before_the_change_is_false_and_after_it_has_a_delay(
    change: int | None, fired: int | None, false: bool, delay: int | None
) -> None:
    judged = Row(0, "rect1 on abs", "vhgp", change, fired, "dy" if fired else None)
    assert (judged.false, judged.delay) == (false, delay)
