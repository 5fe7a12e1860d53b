# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Suggested pushes: candidates within a robot's limits, and the batch of which a model learns most."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from coarse import coarse_simulator
from drifting_models import extended, slippery
from drifting_models import pushes as drifting_pushes
from synthetic import noisy_pushes, square_pushes, square_rig

from push_predictor.design import batch
from push_predictor.design.batch import (
    CHOSEN_OF_PRIOR,
    FIRST,
    Suggested,
    _per_second,
    _spread_evenly,
    information_of,
    suggest_pushes,
)
from push_predictor.design.candidates import Courses, candidate_pushes, courses
from push_predictor.design.limits import Limits
from push_predictor.errors import RequestError
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.prior import CORRELATION
from push_predictor.models.predictors import PriorPredictor
from push_predictor.models.push_model import USUAL_SPEED, PushModel
from push_predictor.models.pushes import Push, Pushes
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.planning.persistence import persistence_of
from push_predictor.recordings.table import PushTable, empty_table
from push_predictor.simulation.outcomes import push_outcomes
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.spec import SimulationSpec, simulated_rig

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def an_eighth_of_the_pushes() -> Iterator[None]:
    """Time is proportional to the candidates, and to the pushes that matter."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batch, "CANDIDATES", batch.CANDIDATES // 8)
        patch.setattr(batch, "MATTER", batch.MATTER // 8)
        yield


@pytest.fixture(scope="module")
def untrained() -> PushModel:
    """A prior model whose mechanics are accurate to 1 %: the derivatives by its parameters take most of the time."""
    model = train_model(empty_table(), square_rig(), "prior", name="before")
    assert isinstance(model.predictor, PriorPredictor)
    fitted = model.predictor.fitted
    assert "rim_exponent" in fitted.values  # no support is known
    coarse = replace(fitted, mechanics=replace(fitted.mechanics, accuracy=0.01))
    return replace(model, predictor=replace(model.predictor, fitted=coarse))


@pytest.fixture(scope="module")
def suggested(untrained: PushModel) -> Suggested:
    """The first pushes, where nothing limits them."""
    return suggest_pushes(untrained, 8)


@pytest.fixture(scope="module")
def learnt() -> PushModel:
    return train_model(noisy_pushes(90), square_rig(), "gp", name="gp", options=TrainingOptions(mean="zero"))


def few_pushes(count: int, about: FittedMechanics | None = None) -> PushModel:
    """A GP of so many pushes, about nothing or about mechanics."""
    table = noisy_pushes(90)
    rows = table.take(np.isin(table.push_id, table.pushes[:count]))
    return train_model(rows, square_rig(), "gp", name="few", options=TrainingOptions(mean="zero", about=about))


def one_side(table: PushTable) -> PushTable:
    """The windows with a positive angle."""
    return table.take(table.inputs[:, 2] > 0.0)


class TestCandidates:
    def test_fill_the_limits_evenly(self, learnt: PushModel) -> None:
        limits = Limits(speed=(0.02, 0.06), angle=(-0.5, 0.9), excluded=((0.25, 0.5),))
        found = candidate_pushes(learnt, limits, 300)
        assert found.shape == (300, 3)
        np.testing.assert_allclose(found.min(axis=0), [0.02, 0.0, -0.5], atol=0.02)
        np.testing.assert_allclose(found.max(axis=0), [0.06, 1.0, 0.9], atol=0.02)
        assert limits.allows(found[:, 1]).all()
        assert np.histogram(found[:, 1], 4, (0.0, 1.0))[0] == pytest.approx([100, 0, 100, 100], abs=8)

    @pytest.mark.parametrize("excluded", [0.5, 0.8, 0.985])
    def test_a_small_part_of_the_outline_is_filled_too(self, learnt: PushModel, excluded: float) -> None:
        found = candidate_pushes(learnt, Limits(excluded=((0.0, excluded),)), 256)
        assert found.shape == (256, 3) and found[:, 1].min() > excluded

    def test_an_outline_of_which_hardly_anything_is_left_is_refused(
        self, learnt: PushModel, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("push_predictor.design.candidates.MOST_DRAWN", 2**13)
        slits = tuple((k / 1000 + 1e-9, (k + 1) / 1000 - 1e-9) for k in range(1000))
        with pytest.raises(RequestError, match=r"excluded.*leave more of the outline"):
            candidate_pushes(learnt, Limits(excluded=slits), 1024)

    def test_follow_the_slider_as_the_simulator_moves_it(self) -> None:
        plan = PushPlan(np.array([0.1, 0.4, 0.7]), np.array([0.2, -0.5, 0.0]), np.full(3, 0.02), np.full(3, 0.03))
        spec = SimulationSpec("rect1", "abs", plan)
        with coarse_simulator(3.0):
            table = push_outcomes(spec)
        model = train_model(empty_table(), simulated_rig(spec), "prior", name="m")
        first = np.array([table.inputs[table.push_id == push][0] for push in ("0", "1", "2")])
        found = courses(model, first, 0.03)
        assert found.kept.sum(axis=1).tolist() == [7, 7, 7]
        for k, push in enumerate(("0", "1", "2")):
            rows = table.inputs[table.push_id == push]
            last = len(rows) - 1
            np.testing.assert_allclose(found.inputs[k, last, 1:], rows[last, 1:], atol=0.08)
            assert np.abs(found.inputs[k, last] - found.inputs[k, 0]).max() > 0.01 or k == 2

    def test_of_other_speeds_have_other_numbers_of_windows(self, untrained: PushModel) -> None:
        inputs = np.array([[0.02, 0.1, 0.0], [0.05, 0.1, 0.0], [0.2, 0.1, 0.0]])
        found = courses(untrained, inputs, 0.03)
        assert found.kept.sum(axis=1).tolist() == [7, 3, 1]
        np.testing.assert_array_equal(found.windows.inputs.reshape(3, 7, 3)[2], np.tile(inputs[2], (7, 1)))
        between = np.abs(np.subtract.outer(np.arange(7), np.arange(7)))
        np.testing.assert_allclose(found.distance[1], 0.01 * between)

    def test_end_where_the_tip_leaves_the_slider(self, untrained: PushModel) -> None:
        found = courses(untrained, np.array([[0.05, 0.01, 1.35]]), 0.1)
        assert 1 <= found.kept.sum() < 10
        assert not np.any(np.diff(found.kept[0].astype(int)) > 0)


class TestSuggestedPushes:
    def test_are_within_the_limits(self, untrained: PushModel) -> None:
        limits = Limits(speed=(0.02, 0.06), angle=(-0.5, 0.9), travel=0.02, excluded=((0.25, 0.5),))
        found = suggest_pushes(untrained, 8, limits)
        assert len(found) == 8 and limits.allows(found.inputs[:, 1]).all()
        assert np.all((found.inputs[:, 0] >= 0.02) & (found.inputs[:, 0] <= 0.06))
        assert np.all((found.inputs[:, 2] >= -0.5) & (found.inputs[:, 2] <= 0.9))
        np.testing.assert_allclose(found.duration * found.inputs[:, 0], 0.02)

    def test_of_a_learnt_model_are_spread_evenly_up_to_the_tenth(self, untrained: PushModel) -> None:
        known, short = few_pushes(7), Limits(travel=0.004)
        expected = candidate_pushes(known, short, 64)
        found = suggest_pushes(known, 4, short).inputs
        np.testing.assert_array_equal(found[:3], expected[7:FIRST])
        assert not np.array_equal(found[3], expected[FIRST])
        chosen = suggest_pushes(known, 1, short, matter=Pushes(0.03, 0.1, 0.3))
        assert not np.array_equal(chosen.inputs[0], expected[7])
        assert _spread_evenly(known, 2) == [7, 8]
        assert _spread_evenly(few_pushes(FIRST), 2) == [None, None]
        rig = square_rig()
        mechanics = FittedMechanics(PushMechanics(rig.outline, rig.pusher_radius), {"contact_friction": 0.25})
        assert _spread_evenly(few_pushes(4, mechanics), 2) == [None, None]

    def test_of_a_prior_model_are_spread_evenly_from_the_sixth_on(self, untrained: PushModel) -> None:
        short = Limits(travel=0.004)
        expected = candidate_pushes(untrained, short, 64)
        found = suggest_pushes(untrained, 8, short).inputs
        np.testing.assert_array_equal(found[CHOSEN_OF_PRIOR:], expected[CHOSEN_OF_PRIOR:8])
        assert not np.array_equal(found[:CHOSEN_OF_PRIOR], expected[:CHOSEN_OF_PRIOR])
        many = train_model(noisy_pushes(batch.CANDIDATES + 4, windows_per_push=1), square_rig(), "prior", name="many")
        assert _spread_evenly(many, 2) == [4, 5]  # after its last candidate the sequence starts again

    def test_are_where_the_model_was_not_trained(self) -> None:
        known = train_model(
            one_side(noisy_pushes(90)), square_rig(), "gp", name="one side", options=TrainingOptions(mean="zero")
        )
        found = suggest_pushes(known, 5, Limits(angle=(-1.0, 1.0)))
        assert np.mean(found.inputs[:, 2] < 0.0) >= 0.8
        assert 0.0 < found.variance_left[-1] < found.variance_left[0] < 1.0

    def test_are_where_it_matters(self, learnt: PushModel) -> None:
        rng = np.random.default_rng(0)
        matter = Pushes(0.03, 0.05 + 0.1 * rng.random(50), 0.8 + 0.1 * rng.random(50))
        found = suggest_pushes(learnt, 4, matter=matter)
        assert np.all(found.inputs[:, 2] > 0.3)

    def test_windows_of_a_push_tell_less_than_as_many_pushes(self, untrained: PushModel) -> None:
        inputs = np.array([[0.02, 0.1, 0.3]])
        windows = courses(untrained, inputs, 0.016)
        matter = Push(candidate_pushes(untrained, Limits(), 64), np.full(64, 0.2), {})
        together = information_of(untrained, windows, matter)
        w = windows.kept.shape[1]
        assert w == 4
        noise = together.noise[0].reshape(w, 3, w, 3)
        np.testing.assert_allclose(noise[0, 1, 2, 1], CORRELATION)
        np.testing.assert_allclose(noise[0, 1, 0, 1], 1.0)
        assert noise[0, 1, 2, 0] == 0.0

    def test_the_windows_of_a_learnt_model_correlate_as_its_residuals_do(self) -> None:
        known = train_model(
            drifting_pushes(40), square_rig(), "gp", name="shared", options=TrainingOptions(mean="zero")
        )
        tried = courses(known, np.array([[0.02, 0.1, 0.3]]), 0.012)
        found = information_of(known, tried, Push(tried.inputs[0], np.full(3, 0.2), {}))
        noise = found.noise[0].reshape(3, 3, 3, 3)
        expected = persistence_of(known).correlation(np.array([0.008]))[0]
        assert expected.max() > 0.05
        np.testing.assert_allclose([noise[0, k, 2, k] for k in range(3)], expected)

    @pytest.mark.parametrize("name", ["learnt", "untrained"])
    def test_a_window_that_a_push_lacks_tells_nothing(self, name: str, request: pytest.FixtureRequest) -> None:
        model = request.getfixturevalue(name)
        inputs = np.array([[0.02, 0.1, 0.3]])
        windows = courses(model, inputs, 0.012)
        longer = Courses(
            np.concatenate([windows.inputs, windows.inputs[:, :1]], axis=1),
            np.concatenate([windows.kept, [[False]]], axis=1),
            windows.duration,
        )
        matter = Push(candidate_pushes(model, Limits(), 64), np.full(64, 0.2), {})
        gains = [information_of(model, one, matter).gains() for one in (windows, longer)]
        np.testing.assert_allclose(*gains, rtol=0.02)

    def test_with_a_transfer_speed_the_way_around_the_slider_counts(
        self, untrained: PushModel, suggested: Suggested
    ) -> None:
        inputs = np.array([[0.02, 0.1, 0.0], [0.03, 0.3, 0.0], [0.02, 0.9, 0.0]])
        per_second = _per_second(untrained, inputs, Limits(travel=0.03, transfer_speed=0.1))
        assert per_second is not None
        np.testing.assert_allclose(1.0 / per_second([]), [1.5, 1.0, 1.5])
        perimeter = untrained.rig.outline.perimeter
        np.testing.assert_allclose(1.0 / per_second([1, 0]), [1.5, 1.0 + 2.0 * perimeter, 1.5 + 2.0 * perimeter])
        assert _per_second(untrained, inputs, Limits()) is None
        near = suggest_pushes(untrained, 6, Limits(transfer_speed=0.005))
        assert _way(near.inputs[:, 1]) < 0.5 * _way(suggested.inputs[:6, 1])

    def test_an_extended_model_needs_its_covariates(self) -> None:
        table = drifting_pushes(40)
        model = extended(
            train_model(table, square_rig(), "gp", name="base", options=TrainingOptions(mean="zero")),
            slippery(0.1, 0.05),
        )
        with pytest.raises(RequestError, match="covariate elapsed_time"):
            suggest_pushes(model, 2)
        assert len(suggest_pushes(model, 2, covariates={"elapsed_time": 900.0})) == 2

    @pytest.mark.parametrize("count", [0, 201])
    def test_a_wrong_count_is_refused(self, untrained: PushModel, count: int) -> None:
        with pytest.raises(RequestError, match="count"):
            suggest_pushes(untrained, count)

    def test_pushes_that_matter_must_be_predictable(self, learnt: PushModel) -> None:
        with pytest.raises(RequestError, match="duration"):
            suggest_pushes(learnt, 1, matter=Pushes(0.03, 0.1, 0.0, duration=3.0))


def _way(contact: np.ndarray) -> float:
    """Fractions of the perimeter that the tip passes from push to push."""
    away = np.abs(np.diff(contact))
    return float(np.sum(np.minimum(away, 1.0 - away)))


# --- the limits of a robot ---


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("speed", [(0.0, 0.1), (0.1, 0.05), (0.1, np.inf), (np.nan, 0.1), (1e-310, 0.1), (0.03 / 601.0, 0.1)]),
        ("angle", [(-1.6, 0.0), (0.0, 1.6), (0.5, 0.4)]),
        ("travel", [0.0, 1.1]),
        ("transfer_speed", [0.0, np.inf]),
        ("excluded", [((-0.1, 0.2),), ((0.1, 1.2),), ((0.0, 0.995),)]),
    ],
)
def test_a_value_out_of_range_is_refused_by_name(field: str, values: list[Any]) -> None:
    for value in values:
        with pytest.raises(RequestError, match=field):
            Limits(**{field: value})


def test_a_push_may_last_ten_minutes_and_a_window_be_a_metre_long() -> None:
    table, rig = square_pushes(30)
    model = train_model(table, rig, "analytical", name="m")
    fastest = 1.0 / model.usual_duration
    limits = Limits(speed=(0.03 / 599.0, 0.999 * fastest))
    assert limits.ranges(model)[0] == limits.speed
    with pytest.raises(RequestError, match=r"speed.*at most 5 m/s"):
        Limits(speed=(0.1, 1.001 * fastest)).ranges(model)


def test_excluded_contacts_are_not_allowed() -> None:
    limits = Limits(excluded=((0.2, 0.3), (0.9, 0.1)))
    contact = np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.85, 0.9, 0.95])
    allowed = [False, False, False, True, False, False, False, True, True, False, False]
    assert limits.allows(contact).tolist() == allowed


def test_by_default_speeds_are_those_of_training_and_angles_at_least_one_radian() -> None:
    table, rig = square_pushes(30)
    model = train_model(table, rig, "analytical", name="m")
    assert Limits().ranges(model) == ((0.02, 0.02), (-1.0, 1.0))
    model.training.inputs[0] = [0.01, 0.1, 1.3]
    assert Limits().ranges(model) == ((0.01, 0.02), (-1.0, 1.3))
    assert Limits(speed=(0.1, 0.2), angle=(-0.2, 0.1)).ranges(model) == ((0.1, 0.2), (-0.2, 0.1))


def test_an_untrained_model_is_pushed_at_the_usual_speed() -> None:
    corners = np.array([[0.04, 0.04, 0.5], [-0.04, 0.04, 0.25], [0.0, -0.04, 0.25]])  # a patch takes a second
    rig = replace(square_pushes(1)[1], support_points=corners)
    model: PushModel = train_model(empty_table(), rig, "prior", name="m")
    assert Limits().ranges(model) == ((USUAL_SPEED, USUAL_SPEED), (-1.0, 1.0))
