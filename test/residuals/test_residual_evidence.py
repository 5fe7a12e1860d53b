# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a search may trust and try: inputs inside training, blocks, held-out pushes, forms, shared sums."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from made_up_traces import pushes
from synthetic import square_pushes, square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import Nuisance, candidate
from push_predictor.residuals.channels.contrast import MOST_NEAR, step_places_near
from push_predictor.residuals.evidence.drivers import (
    STEPS,
    at_touch,
    forms_of,
    screening_bases,
    standard_basis,
    step_places,
)
from push_predictor.residuals.evidence.input_shift import _apart, about_mechanics, input_shift, widened
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.loading import LoadedData
from push_predictor.residuals.evidence.residualizer import SINGULAR, Residualizer, sums_by
from push_predictor.residuals.evidence.standardised import blocks_of, evidence_of, held_out_rows, whitened_response
from push_predictor.residuals.question import ALPHA_SHARES, Question
from push_predictor.residuals.selection.gate import baseline_of
from push_predictor.residuals.selection.screening import AT_ONCE, Scores, screen
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


@pytest.mark.parametrize(("most", "listed"), [(0.25, ["contact"]), (0.9, [])])
def test_one_side_of_a_symmetric_slider_is_a_part_and_nearly_all_of_training_is_none(
    known: PushTable, most: float, listed: list[str]
) -> None:
    part = known.take(known.inputs[:, 1] < most)
    assert [each.covariate for each in input_shift(trained(known), part).inputs] == listed


def test_the_input_with_the_smallest_part_comes_first(known: PushTable) -> None:
    """A few windows outside do not decide, unless they are an extrapolation."""
    two_speeds = with_inputs(known, 0, np.where(np.arange(len(known)) % 3 == 0, 0.02, 0.05))
    part = with_inputs(known, 0, np.full(len(known), 0.02)).take(known.inputs[:, 2] > -0.2)
    angle = part.inputs[:, 2].copy()
    angle[0] = known.inputs[:, 2].max() + 0.15
    speed, other = input_shift(trained(two_speeds), with_inputs(part, 2, angle)).inputs
    assert (speed.covariate, other.covariate) == ("velocity", "angle")
    assert speed.share_unvisited > other.share_unvisited and other.share_outside > speed.share_outside == 0.0


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


# --- forms ------------------------------------------------------------------------------------------------------------


TABLE = pushes(60, 2)


def forms(covariate: str) -> Counter[tuple[str, bool]]:
    """Names of the forms, and whether each has an offset, with their numbers."""
    return Counter((form.name, form.offset) for form in forms_of(covariate, TABLE))


def starts(form: DriverBasis) -> float:
    """The largest value of a form at the least value of its covariate."""
    values, covariate = form.values(TABLE.covariates, len(TABLE)), TABLE.covariates[form.drivers[0]]
    return float(np.abs(values[covariate == covariate.min()]).max())


def test_a_category_may_have_any_size_at_every_level() -> None:
    (form,) = forms_of("edge", TABLE)
    assert (form.name, form.offset, form.levels) == ("category", True, (0.0, 1.0, 2.0, 3.0))


@pytest.mark.parametrize("heading", ["slider_heading", "push_heading"])
def test_of_a_heading_it_is_periodic(heading: str) -> None:
    assert forms(heading) == {("periodic", True): 1, ("periodic, twice around", True): 1}


@pytest.mark.parametrize("covariate", ["elapsed_time", "push_index"])
def test_along_what_only_grows_it_sets_in_grows_or_is_a_line(covariate: str) -> None:
    expected = {("step", False): STEPS, ("linear", False): 1, ("logarithmic", False): 2, ("linear", True): 1}
    assert forms(covariate) == expected


def test_along_another_covariate_it_may_be_curved_too() -> None:
    table = pushes(60, 2)
    del table.covariates["slider_y"]
    found = Counter((form.name, form.offset) for form in forms_of("slider_x", table))
    assert found["quadratic", True] == 1 and found["step", False] == STEPS and found["logarithmic", False] == 1
    assert not found["map", True]


def test_along_the_place_it_may_be_a_map() -> None:
    assert forms("slider_x")["map", True] == forms("slider_y")["map", True] == 1


def test_without_an_offset_it_is_nothing_at_the_start() -> None:
    for form in forms_of("elapsed_time", TABLE):
        assert (starts(form) > 0.0) == form.offset, form


def test_one_growth_levels_off_far_sooner_than_the_other() -> None:
    late, soon = (form for form in forms_of("elapsed_time", TABLE) if form.name == "logarithmic")
    early = TABLE.covariates["elapsed_time"] <= 200.0
    half = [f.values(TABLE.covariates, len(TABLE))[early].max() / f.values(TABLE.covariates, len(TABLE)).max()
            for f in (late, soon)]  # fmt: skip
    assert half[0] < 0.4 and half[1] > 0.55


def test_places_of_a_step_lie_between_values_and_divide_the_windows_evenly() -> None:
    values = np.repeat(np.random.default_rng(0).normal(size=200), 3)
    places = step_places(values)
    assert len(places) == STEPS and not set(places) & set(values)
    shares = [float(np.mean(values < place)) for place in places]
    np.testing.assert_allclose(shares, np.arange(1, STEPS + 1) / (STEPS + 1.0), atol=0.02)


@pytest.mark.parametrize(
    ("values", "places"), [([4.0, 4.0], []), ([4.0, 5.0, 5.0], [4.5]), ([1.0, 2.0, 4.0], [1.5, 3.0])]
)
def test_few_values_have_few_places(values: list[float], places: list[float]) -> None:
    assert step_places(np.array(values)) == places


def test_near_a_place_are_all_places_between_its_neighbours() -> None:
    values = np.arange(100.0)
    tried = step_places(values)
    near = step_places_near(values, tried[3], 60)
    assert near == [v + 0.5 for v in range(100) if tried[2] < v + 0.5 < tried[4]]
    assert min(step_places_near(values, tried[0], 60)) == 0.5
    assert max(step_places_near(values, tried[-1], 60)) == 98.5


def test_not_more_places_are_tried_near_another_than_the_most() -> None:
    values = np.arange(3000.0)
    near = step_places_near(values, step_places(values)[4])
    assert 0.5 * MOST_NEAR < len(near) <= MOST_NEAR


# --- shared sums ------------------------------------------------------------------------------------------------------


def test_sums_by_block_follow_the_blocks_numbers_in_any_order_of_rows() -> None:
    block, values = np.array([7, 2, 7, 5, 2]), np.arange(10.0).reshape(5, 2)
    np.testing.assert_array_equal(sums_by(block, values), [[10.0, 12.0], [6.0, 7.0], [4.0, 6.0]])


def test_scores_in_training_do_not_depend_on_what_was_scored_before(deployed: PushModel) -> None:
    evidence = evidence_of(deployed, pushes(40, 2))
    drift = standard_basis("linear", "elapsed_time", evidence.table.covariates["elapsed_time"])
    tried = [
        candidate(evidence, mechanism, covariate, basis)
        for mechanism in ("contact_friction", "pusher_travel")
        for covariate, basis in (("elapsed_time", drift), ("elapsed_time", DriverBasis("constant")))
    ]
    after_others = baseline_of(deployed, evidence.mechanics)
    for one in tried:
        found, information = after_others.scores(one)
        alone, expected = baseline_of(deployed, evidence.mechanics).scores(one)
        np.testing.assert_allclose(found.rows, alone.rows, atol=1e-12 * np.abs(alone.rows).max())
        np.testing.assert_allclose(information, expected, atol=1e-12 * np.abs(expected).max())


def test_nuisance_columns_are_orthonormal_and_span_the_constant_effects(deployed: PushModel) -> None:
    evidence = evidence_of(deployed, pushes(60, 3))
    names = ["contact_friction", "pusher_travel", "centre_of_friction"]
    responses = {name: whitened_response(evidence, name) for name in names}
    inputs = inputs_basis(deployed, evidence.table)
    nuisance = Nuisance(evidence, inputs, names, responses.__getitem__)
    drift = standard_basis("linear", "elapsed_time", evidence.table.covariates["elapsed_time"])
    columns = nuisance.of_change("pusher_travel", "elapsed_time", drift, "driven")
    assert columns is not None
    np.testing.assert_allclose(columns.T @ columns, np.eye(columns.shape[1]), atol=1e-8)
    q, _ = np.linalg.qr(inputs.columns)
    for name in names:
        flat = responses[name].reshape(len(q), -1)
        apart = (flat - q @ (q.T @ flat)).reshape(len(columns), -1)
        left = apart - columns @ (columns.T @ apart)
        assert np.linalg.norm(left) < 1e-2 * np.linalg.norm(flat)


def block_by_block(values: np.ndarray, rows: list[np.ndarray], hat: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """(1 - H)^-1/2 times the values (n, 3) of each block, with the part H of the hat matrix in its rows."""
    adjusted = values.copy()
    for block in rows:
        part = hat(block)
        size, vectors = np.linalg.eigh(np.eye(len(part)) - part)
        root = vectors / np.sqrt(np.maximum(size, SINGULAR)) @ vectors.T
        adjusted[block] = (root @ values[block].reshape(len(part), -1)).reshape(values[block].shape)
    return adjusted


def test_blocks_of_any_sizes_are_adjusted_each_for_itself() -> None:
    rng = np.random.default_rng(0)
    block = np.repeat([4, 1, 0, 9, 2], [3, 1, 3, 2, 20])
    rows = [np.flatnonzero(block == b) for b in np.unique(block)]
    residualizer = Residualizer(rng.normal(size=(29, 4)))
    q, z = residualizer.q, rng.normal(size=(29, 3))
    found = residualizer.blocks(z, block)
    expected = block_by_block(residualizer(z), rows, lambda r: q[r] @ q[r].T)
    np.testing.assert_allclose(found.adjusted, expected, atol=1e-12)
    columns = np.linalg.qr(rng.normal(size=(87, 5)))[0]
    there = columns.reshape(29, 3, 5)
    flat = found.adjusted.ravel()
    apart = (flat - columns @ (columns.T @ flat)).reshape(29, 3)
    expected = block_by_block(apart, rows, lambda r: there[r].reshape(-1, 5) @ there[r].reshape(-1, 5).T)
    np.testing.assert_allclose(found.orthogonal_to(columns).adjusted, expected, atol=1e-12)


def test_candidates_are_screened_together_as_each_alone() -> None:
    rng = np.random.default_rng(1)
    rows = [rng.normal(size=(40, p)) * rng.uniform(0.1, 3.0, p) for p in rng.integers(0, 6, AT_ONCE + 9)]
    scores = [Scores(each, each.sum(axis=0)) for each in rows]
    together, alone = screen(scores, 3), [screen([score], 3) for score in scores]
    np.testing.assert_allclose(together.statistic, [float(each.statistic[0]) for each in alone], rtol=1e-12)
    largest = np.max([each.largest for each in alone], axis=0)
    np.testing.assert_allclose(together.largest, largest, rtol=1e-9)
    exceeded = np.mean(np.append(largest, np.inf) >= together.statistic[:, None], axis=1)
    np.testing.assert_allclose(together.p_value, exceeded, rtol=1e-12)


def test_candidates_are_searched_by_the_secant_over_95_percent_of_rigs(deployed: PushModel) -> None:
    evidence = evidence_of(deployed, pushes(20, 2))
    end = np.full((len(evidence.table), 1), 2.0 * BY_NAME["centre_x"].spread)
    more, less = (evidence.mechanics.shifted(("centre_x",), side * end, evidence.push)[0] for side in (1.0, -1.0))
    secant = np.einsum("nij,nj->ni", evidence.whitener, (more - less) / (2.0 * end[0]))
    np.testing.assert_allclose(whitened_response(evidence, "centre_of_friction")[:, :, 0], secant, rtol=1e-9, atol=1e-9)
