# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a search may trust: inputs inside training, blocks of pushes that share a disturbance, held-out pushes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from synthetic import square_pushes, square_rig

from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.drivers import at_touch, screening_bases
from push_predictor.residuals.evidence.input_shift import _apart, about_mechanics, input_shift, widened
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.loading import LoadedData
from push_predictor.residuals.evidence.standardised import blocks_of, evidence_of, held_out_rows
from push_predictor.residuals.question import ALPHA_SHARES, Question
from push_predictor.types import Array


@cache
def trained(table: PushTable, kind: str = "gp") -> PushModel:
    return train_model(table, square_rig(), kind, name="deployed", options=TrainingOptions(mean="zero"))


@pytest.fixture(scope="module")
def known() -> PushTable:
    return square_pushes(60)[0]


def with_inputs(table: PushTable, column: int, values: Array) -> PushTable:
    inputs = table.inputs.copy()
    inputs[:, column] = values
    return replace(table, inputs=inputs)


def test_pushes_like_those_of_training_are_no_shift(known: PushTable) -> None:
    shift = input_shift(trained(known), known)
    assert shift.inputs == () and not shift.outside.any()


@pytest.mark.parametrize("factor, shifted", [(1.1, False), (0.9, False), (1.4, True), (0.5, True)])
def test_speeds_beyond_the_margin_are_a_shift(known: PushTable, factor: float, shifted: bool) -> None:
    one_speed = with_inputs(known, 0, np.full(len(known), 0.02))
    shift = input_shift(trained(one_speed), with_inputs(known, 0, np.full(len(known), 0.02 * factor)))
    assert [each.covariate for each in shift.inputs] == (["velocity"] if shifted else [])
    assert shift.outside.all() == shifted
    if shifted:
        assert shift.inputs[0].share_outside == 1.0
        assert shift.inputs[0].training == (0.02, 0.02) and shift.inputs[0].now == pytest.approx((0.02 * factor,) * 2)


def test_a_few_windows_outside_are_no_shift(known: PushTable) -> None:
    speeds = np.full(len(known), 0.02)
    speeds[: len(known) // 25] = 0.1
    model = trained(with_inputs(known, 0, np.full(len(known), 0.02)))
    assert input_shift(model, with_inputs(known, 0, speeds)).inputs == ()


@pytest.mark.parametrize(("column", "low", "high"), [(1, 0.0, 0.3), (2, -0.2, 0.3)])
def test_pushes_in_a_part_of_training_are_listed_and_lie_inside(
    known: PushTable, column: int, low: float, high: float
) -> None:
    part = known.take((known.inputs[:, column] >= low) & (known.inputs[:, column] <= high))
    shift = input_shift(trained(known), part)
    (one,) = (each for each in shift.inputs if each.covariate == ("velocity", "contact", "angle")[column])
    assert one.share_outside == 0.0 and not one.extrapolates and not shift.outside.any()
    margin = {1: 0.03, 2: 0.1}[column]
    beyond = np.mean((known.inputs[:, column] > high + margin) | (known.inputs[:, column] < low - margin))
    assert 0.7 * beyond < one.share_unvisited <= beyond  # the margin grows where contacts are few


def test_one_side_of_a_symmetric_slider_is_a_part(known: PushTable) -> None:
    one_side = known.take(known.inputs[:, 1] < 0.25)
    assert [each.covariate for each in input_shift(trained(known), one_side).inputs] == ["contact"]


def test_the_input_with_the_smallest_part_comes_first(known: PushTable) -> None:
    """A few windows outside do not decide, unless they are an extrapolation."""
    two_speeds = with_inputs(known, 0, np.where(np.arange(len(known)) % 3 == 0, 0.02, 0.05))
    part = with_inputs(known, 0, np.full(len(known), 0.02)).take(known.inputs[:, 2] > -0.2)
    angle = part.inputs[:, 2].copy()
    angle[0] = known.inputs[:, 2].max() + 0.15
    speed, other = input_shift(trained(two_speeds), with_inputs(part, 2, angle)).inputs
    assert (speed.covariate, other.covariate) == ("velocity", "angle")
    assert speed.share_unvisited > other.share_unvisited and other.share_outside > speed.share_outside == 0.0


def test_nearly_all_of_training_is_no_part(known: PushTable) -> None:
    assert input_shift(trained(known), known.take(known.inputs[:, 1] < 0.9)).inputs == ()


def test_few_windows_outside_are_no_extrapolation_where_the_others_are_a_part(known: PushTable) -> None:
    speeds = np.where(np.arange(len(known)) % 3 == 0, 0.05, 0.02)
    model = trained(with_inputs(known, 0, speeds))
    new = np.where(np.arange(len(known)) % 50 == 49, 0.005, 0.02)
    shift = input_shift(model, with_inputs(known, 0, new))
    (one,) = shift.inputs
    assert one.covariate == "velocity" and 0.0 < one.share_outside < 0.05
    assert not one.extrapolates and not shift.outside.any()


def test_the_most_shifted_input_comes_first(known: PushTable) -> None:
    narrow = known.take(np.abs(known.inputs[:, 2]) < 0.3)
    new = with_inputs(known, 0, np.where(np.arange(len(known)) % 10 == 0, 3.0, 1.0) * narrow.inputs[:, 0].max())
    shift = input_shift(trained(narrow), new)
    assert [each.covariate for each in shift.inputs] == ["angle", "velocity"]
    assert shift.inputs[0].share_outside > shift.inputs[1].share_outside >= 0.05


def test_contacts_far_from_all_of_training_are_a_shift_and_symmetric_ones_are_not(known: PushTable) -> None:
    left = known.take(np.mod(4.0 * known.inputs[:, 1], 1.0) < 0.5)
    model = trained(left)
    other_side = with_inputs(left, 1, np.mod(left.inputs[:, 1] + 0.25, 1.0))
    assert input_shift(model, other_side).inputs == ()
    (shift,) = input_shift(model, with_inputs(left, 1, np.mod(left.inputs[:, 1] + 0.125, 1.0))).inputs
    assert shift.covariate == "contact" and shift.share_outside > 0.3


def test_mechanics_that_learnt_nothing_extrapolate_to_other_speeds_alone(known: PushTable) -> None:
    narrow = known.take((np.abs(known.inputs[:, 2]) < 0.4) & (np.mod(4.0 * known.inputs[:, 1], 1.0) < 0.6))
    model = trained(narrow, "analytical")
    assert input_shift(model, known).inputs == () and not input_shift(model, known).outside.any()
    faster = input_shift(model, with_inputs(known, 0, np.full(len(known), 3.0 * known.inputs[:, 0].max())))
    assert [each.covariate for each in faster.inputs] == ["velocity"] and faster.outside.all()
    assert "angle" in {each.covariate for each in input_shift(trained(narrow), known).inputs}


def test_predicted_deviations_grow_with_the_travel_beyond_training(known: PushTable) -> None:
    slow = with_inputs(known, 0, np.full(len(known), 0.02))
    fast = with_inputs(known, 0, np.full(len(known), 0.06))
    model = trained(slow, "analytical")
    evidence = evidence_of(model, fast)
    wider = widened(evidence, model, input_shift(model, fast))
    assert wider.z == pytest.approx(evidence.z / 3.0)
    same = evidence_of(model, slow)
    assert widened(same, model, input_shift(model, slow)) is same


def test_the_question_has_the_analysis_pushes_alone_each_with_its_own_deviation(known: PushTable) -> None:
    slow = with_inputs(replace(known, outcomes=1.01 * known.outcomes), 0, np.full(len(known), 0.02))  # other pushes
    half = np.arange(len(known)) % 2 == 0
    mixed = with_inputs(known, 0, np.where(half, 0.06, 0.02))
    question = Question.of(trained(slow, "analytical"), LoadedData(mixed, None, square_rig()))
    analysis = ~held_out_rows(mixed)
    np.testing.assert_array_equal(question.inside, ~half[analysis])
    plain = evidence_of(trained(slow, "analytical"), mixed.take(analysis))
    factor = np.where(half[analysis], 3.0, 1.0)[:, None]
    assert question.evidence.z == pytest.approx(plain.z / factor)


@pytest.mark.parametrize("per_path", [True, False])
def test_deviations_beyond_training_grow_once(known: PushTable, per_path: bool) -> None:
    """Outcomes learnt per path length have predicted deviations that grow with it."""
    fast = with_inputs(known, 0, np.full(len(known), 0.06))
    options = TrainingOptions(mean="zero", per_path=per_path)
    slow = with_inputs(known, 0, np.full(len(known), 0.02))
    model = train_model(slow, square_rig(), "gp", name="learnt", options=options)
    at_training, beyond = evidence_of(model, slow), evidence_of(model, fast)
    wider = widened(beyond, model, input_shift(model, fast))
    assert (wider is beyond) == per_path
    before, after = (np.diagonal(np.linalg.inv(e.whitener), axis1=1, axis2=2) ** 2 for e in (at_training, wider))
    base = model.predictor.base
    assert isinstance(base, GaussianProcessPredictor)
    unseen_speed = (0.1 * np.log(3.0) * base.reported_sd) ** 2 if per_path else 0.0
    assert after == pytest.approx(9.0 * (before + unseen_speed))


def test_a_learned_model_is_trained_again_about_mechanics_and_an_analytical_one_stays(known: PushTable) -> None:
    analytical, learned = trained(known, "analytical"), trained(known)
    assert about_mechanics(analytical) is analytical
    informed = about_mechanics(learned)
    assert not informed.predictor.absorbs and len(informed.training) == len(learned.training)


def test_windows_that_begin_with_the_touch_are_known_where_its_time_was_recorded(known: PushTable) -> None:
    since = np.where(np.arange(len(known)) % 3, 0.2, 0.01)
    timed = replace(known, covariates={"time_since_contact": since})
    assert at_touch(timed).tolist() == (since == 0.01).tolist()
    assert not at_touch(replace(known, covariates={})).any()


def test_channels_share_the_false_alarms(known: PushTable) -> None:
    asked = Question.of(trained(known), LoadedData(square_pushes(40, 7)[0], None, square_rig()), alpha=0.02)
    assert [asked.alpha_of(channel) for channel in ALPHA_SHARES] == [0.02 * share for share in ALPHA_SHARES.values()]
    assert sum(ALPHA_SHARES.values()) == pytest.approx(1.0)


@pytest.mark.parametrize(("pushes", "together"), [(90, 10), (27, 3), (5, 1)])
def test_every_third_block_of_pushes_is_held_out_and_few_pushes_have_smaller_blocks(pushes: int, together: int) -> None:
    held = held_out_rows(in_order(pushes))
    assert held.tolist() == [(k // together) % 3 == 2 for k in range(pushes)]


@pytest.mark.parametrize(("pushes", "together"), [(800, 4), (250, 2), (60, 1)])
def test_neighbouring_pushes_share_a_block_where_there_are_enough(pushes: int, together: int) -> None:
    assert blocks_of(in_order(pushes)).tolist() == [k // together for k in range(pushes)]


def in_order(count: int) -> PushTable:
    """A window of each of these pushes."""
    nothing = np.zeros((count, 3))
    return PushTable(nothing, np.full(count, 0.2), nothing, np.arange(count).astype(np.str_))


def test_a_contact_is_far_from_training_beyond_the_margin_and_the_gaps_of_training() -> None:
    dense, sparse = np.linspace(0.0, 0.5, 101), np.linspace(0.0, 1.0, 9)[:-1]
    assert _apart(1, np.array([0.52, 0.55]), dense).tolist() == [False, True]
    assert _apart(1, np.array([0.5625]), sparse).tolist() == [False]


def test_speeds_that_hardly_vary_are_one_speed(known: PushTable) -> None:
    jitter = 1.0 + 1e-3 * np.random.default_rng(0).standard_normal(len(known))
    basis = inputs_basis(trained(known), with_inputs(known, 0, 0.02 * jitter))
    assert np.array_equal(basis.columns, basis.without_speed)


@pytest.mark.parametrize(("levels", "tried"), [(12, True), (13, False)])
def test_a_category_of_many_levels_is_not_tried(levels: int, tried: bool) -> None:
    recording = np.arange(60.0) % levels
    names = [name for name, _ in screening_bases(replace(in_order(60), covariates={"recording": recording}))]
    assert ("recording" in names) == tried
