# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes that a trace proposes to separate rivals, and how the recording of such pushes is taken in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_traces import planted, pushes, slippery
from synthetic import square_rig

from push_predictor.geometry.frames import wrap_angle
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanisms import LIBRARY, Push
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import train_model
from push_predictor.recordings.table import concatenate
from push_predictor.residuals.channels.motion import motion_effects
from push_predictor.residuals.evidence.split import held_out_rows
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of
from push_predictor.residuals.selection.experiment import (
    APART,
    PUSHES,
    ROWS,
    Experiment,
    _apart,
    _chosen,
    _novelty,
    _precision,
    _shift,
    _Trials,
    _trials,
    drivers_of,
    separating_pushes,
)
from push_predictor.residuals.selection.settable import continued

SESSION = pushes(120, 2)
SLID = 0.01 * SESSION.covariates["push_index"]  # m
WARMTH = 20.0 + 0.005 * SESSION.covariates["elapsed_time"]
TABLE = replace(SESSION, covariates={**SESSION.covariates, "slid_distance": SLID, "topic:/warmth": WARMTH})
TRAINING = pushes(60, 1)


@pytest.fixture(scope="module")
def model() -> PushModel:
    return train_model(TRAINING, square_rig(), "analytical", name="deployed")


@pytest.fixture(scope="module")
def evidence(model: PushModel) -> Evidence:
    return evidence_of(model, TABLE)


def along(name: str, size: float = 0.05) -> Effect:
    """A contact friction that changes linearly with a covariate, by `size` per standard deviation."""
    values = TABLE.covariates[name]
    basis = DriverBasis("linear", (name,), (float(values.mean()),), (float(values.std()),))
    return planted("contact_friction", name, basis, size)


def step(name: str, place: float) -> Effect:
    """A contact friction that changes at once."""
    return planted("contact_friction", name, DriverBasis("step", (name,), place=place), 0.1)


def column(found: Experiment, name: str) -> np.ndarray:
    return np.array([push[name] for push in found.pushes])


class TestProposedPushes:
    def test_are_twenty_different_pushes_spread_over_the_inputs(self, evidence: Evidence) -> None:
        found = separating_pushes(evidence, [along("elapsed_time"), along("topic:/warmth")], TRAINING)
        assert len(found.pushes) == PUSHES and not found.inseparable
        contact, angle = column(found, "contact"), column(found, "angle")
        assert len(set(zip(contact, angle, strict=True))) == PUSHES
        away = np.abs(contact[:, None] - contact)
        away = np.hypot(np.minimum(away, 1.0 - away), (angle[:, None] - angle) / (np.pi / 2.0))
        np.fill_diagonal(away, np.inf)
        assert np.median(away.min(axis=1)) > 0.3 * APART
        assert len({int(4.0 * place) for place in contact}) == 4  # all sides

    def test_stay_within_the_inputs_of_training(self, evidence: Evidence) -> None:
        narrow = TRAINING.take(np.abs(TRAINING.inputs[:, 2]) < 0.3)
        found = separating_pushes(evidence, [along("elapsed_time"), along("topic:/warmth")], narrow)
        assert found.pushes and np.abs(column(found, "angle")).max() <= np.abs(narrow.inputs[:, 2]).max()
        inside = TABLE.inputs[:, 1] < 0.5
        found = separating_pushes(evidence, [along("elapsed_time"), along("topic:/warmth")], TRAINING, inside)
        assert found.pushes and column(found, "contact").max() < 0.5

    def test_of_a_topic_and_time_set_the_topic_to_both_ends_while_time_goes_on(self, evidence: Evidence) -> None:
        found = separating_pushes(evidence, [along("elapsed_time"), along("topic:/warmth")], TRAINING)
        warmth, time = column(found, "topic:/warmth"), column(found, "elapsed_time")
        low, high = np.quantile(WARMTH, [0.05, 0.95])
        assert set(warmth) <= {low, high} and low in warmth
        assert time[0] > TABLE.covariates["elapsed_time"].max() and np.all(np.diff(time) > 0.0)
        assert time[0] < 1.1 * TABLE.covariates["elapsed_time"].max()  # no rest is needed

    def test_of_time_and_count_come_after_a_rest(self, evidence: Evidence) -> None:
        found = separating_pushes(evidence, [along("elapsed_time"), along("push_index")], TRAINING)
        time, count = column(found, "elapsed_time"), column(found, "push_index")
        assert time[0] > 1.4 * TABLE.covariates["elapsed_time"].max()
        assert np.array_equal(count, 119.0 + np.arange(1.0, PUSHES + 1.0))
        assert not any("travel" in push for push in found.pushes)

    def test_of_count_and_distance_are_long(self, evidence: Evidence) -> None:
        found = separating_pushes(evidence, [along("slid_distance", 0.1), along("push_index", 0.1)], TRAINING)
        assert np.allclose(column(found, "travel"), 0.08)
        assert np.allclose(np.diff(column(found, "slid_distance")), 0.08)

    def test_of_all_three_rest_first_and_slide_far_afterwards(self, evidence: Evidence) -> None:
        """Time alone grows at first, then distance: together they would not be separated."""
        rivals = [along(name, 0.1) for name in ("elapsed_time", "slid_distance", "push_index")]
        found = separating_pushes(evidence, rivals, TRAINING)
        half = PUSHES // 2
        assert [k for k, push in enumerate(found.pushes) if "travel" in push] == list(range(half, PUSHES))
        slid = column(found, "slid_distance")
        assert slid[half - 1] < 1.1 * SLID.max() and slid[-1] > 1.5 * SLID.max()
        assert column(found, "elapsed_time")[0] > 1.4 * TABLE.covariates["elapsed_time"].max()

    def test_of_headings_turn_the_slider_and_the_push_with_it(self, model: PushModel) -> None:
        basis = DriverBasis("periodic", ("slider_heading",))
        other = DriverBasis("periodic", ("push_heading",))
        rivals = [planted("contact_friction", b.drivers[0], b, 0.05, 0.05) for b in (basis, other)]
        found = separating_pushes(evidence_of(model, TABLE), rivals, TRAINING)
        normal = square_rig().outline.inward_normal(column(found, "contact"))
        away = wrap_angle(
            column(found, "push_heading")
            - column(found, "slider_heading")
            - np.arctan2(normal[:, 1], normal[:, 0])
            - column(found, "angle")
        )
        assert np.abs(away).max() < 1e-9
        assert len(set(np.round(column(found, "slider_heading"), 6))) > 1

    def test_do_not_set_what_no_operator_can(self, model: PushModel) -> None:
        gap = np.random.default_rng(0).normal(0.0, 1e-4, len(TABLE))
        covariates = {**TABLE.covariates, "contact_gap": gap, "previous_residual": gap[::-1].copy()}
        of_gap, of_residual = (
            planted("contact_friction", name, DriverBasis("linear", (name,), (0.0,), (1e-4,)), 0.05)
            for name in ("contact_gap", "previous_residual")
        )
        known = evidence_of(model, replace(TABLE, covariates=covariates))
        found = separating_pushes(known, [along("topic:/warmth"), of_gap, of_residual], TRAINING)
        assert found.pushes
        assert all(not {"contact_gap", "previous_residual"} & set(push) for push in found.pushes)

    def test_are_none_for_rivals_that_nothing_separates(self, evidence: Evidence) -> None:
        """A step in the past: whichever covariate it depends on, it stays."""
        found = separating_pushes(evidence, [step("elapsed_time", 500.0), step("push_index", 59.5)], TRAINING)
        assert found.pushes == () and found.inseparable == ("push_index",)

    def test_are_none_for_a_rival_that_another_size_makes_the_same(self, evidence: Evidence) -> None:
        twice = replace(along("elapsed_time", 0.1), covariate="push_index")
        assert separating_pushes(evidence, [along("elapsed_time", 0.05), twice], TRAINING).pushes == ()

    def test_are_for_the_rivals_that_can_be_separated(self, evidence: Evidence) -> None:
        rivals = [step("elapsed_time", 500.0), step("push_index", 59.5), along("topic:/warmth")]
        found = separating_pushes(evidence, rivals, TRAINING)
        assert found.inseparable == ("push_index",)
        assert found.pushes and all("push_index" not in push for push in found.pushes)

    def test_are_none_without_a_rival(self, evidence: Evidence) -> None:
        assert separating_pushes(evidence, [slippery(0.05)], TRAINING).pushes == ()


def test_contacts_on_both_sides_of_the_first_vertex_are_near() -> None:
    inputs = np.array([[0.02, 0.01, 0.0], [0.02, 0.99, 0.0], [0.02, 0.5, 0.0]])
    novelty = _novelty(inputs, np.array([0]))
    assert novelty[0] == 0.0 and novelty[1] < 0.01 and novelty[2] == 1.0


class TestTrials:
    """What a design compares: the pushes made and those that could be made, as shifts by two rivals."""

    RIVALS = (along("elapsed_time"), along("topic:/warmth"))

    def test_the_pushes_made_count_as_all_windows_of_the_session(self, evidence: Evidence) -> None:
        made = _trials(evidence, np.ones(len(TABLE), dtype=bool), self.RIVALS).made
        every = _shift(evidence, TABLE.covariates, self.RIVALS[0])
        assert len(TABLE) > ROWS and made.shape == (1, 3 * ROWS, 2)
        assert np.sum(made[0, :, 0] ** 2) == pytest.approx(np.sum(every**2), rel=0.1)

    def test_a_further_push_counts_as_its_windows_in_the_middle_of_the_pushes(self, evidence: Evidence) -> None:
        found = _trials(evidence, np.ones(len(TABLE), dtype=bool), self.RIVALS)
        drivers = drivers_of(self.RIVALS)
        middle = continued(TABLE, drivers, PUSHES)["elapsed_time"][PUSHES // 2]
        assert all(np.all(one["elapsed_time"] == middle) for one in found.settings)
        near = evidence.take(found.rows)
        assert len(TABLE) == 3 * len(TABLE.pushes)
        window = _shift(near, found.settings[0], self.RIVALS[0])
        np.testing.assert_allclose(found.tried[0, : len(found.rows), :, 0], np.sqrt(3.0) * window)

    def test_each_other_rival_is_set_to_both_ends(self, model: PushModel) -> None:
        damp = WARMTH[::-1].copy()
        known = evidence_of(model, replace(TABLE, covariates={**TABLE.covariates, "topic:/damp": damp}))
        of_damp = planted(
            "contact_friction", "topic:/damp", DriverBasis("linear", ("topic:/damp",), (20.0,), (1.0,)), 0.05
        )
        found = _trials(known, np.ones(len(TABLE), dtype=bool), [*self.RIVALS, of_damp])
        ends = np.quantile(WARMTH, [0.05, 0.95])
        for name, settings in (("topic:/warmth", found.settings[:2]), ("topic:/damp", found.settings[2:])):
            np.testing.assert_allclose([one[name][0] for one in settings], ends)

    def test_what_the_pushes_made_have_shown_is_not_asked_again(self, evidence: Evidence) -> None:
        """Each of two cases has 150 equally informative candidates; the first case is settled already."""
        rows = np.arange(ROWS)
        tried = np.zeros((2, 2 * ROWS, 3, 2))
        tried[0, :ROWS, 0, 0] = tried[1, ROWS:, 0, 0] = 1.0
        made = np.zeros((2, 3 * ROWS, 2))
        made[0, 0, 0] = 100.0
        order, _ = _chosen(evidence, _Trials((), rows, [{}, {}], made, tried))
        assert np.all(order >= ROWS)
        order, _ = _chosen(evidence, _Trials((), rows, [{}, {}], 0.0 * made, tried))
        assert 5 < np.sum(order >= ROWS) < 15


def test_cases_have_no_unknown_in_common() -> None:
    features = np.arange(12.0).reshape(2, 3, 2)
    found = _apart(features)
    assert found.shape == (2, 6, 2)
    np.testing.assert_array_equal(found[:, :3, 0], features[:, :, 0])
    np.testing.assert_array_equal(found[:, 3:, 1], features[:, :, 1])
    assert not found[:, :3, 1].any() and not found[:, 3:, 0].any()


def test_two_sizes_are_as_certain_as_the_less_certain_one() -> None:
    assert _precision(np.array([[1.0, 0.0], [0.0, 2.0]])) == pytest.approx(1.0, rel=1e-5)
    assert _precision(np.array([[1.0, 1.0], [2.0, 2.0]])) < 1e-5


class TestPushesOfAnExperiment:
    CHOSEN = frozenset(TABLE.pushes[-20:])

    def test_are_never_held_out_and_leave_the_split_of_the_others_alone(self) -> None:
        chosen = np.isin(TABLE.push_id, sorted(self.CHOSEN))
        held = held_out_rows(TABLE, self.CHOSEN)
        assert held.any() and not held[chosen].any()
        assert np.array_equal(held[~chosen], held_out_rows(TABLE.take(~chosen)))

    def test_are_blocks_of_their_own(self, evidence: Evidence) -> None:
        table = pushes(420, 3)
        later = frozenset(table.pushes[-20:])
        shaped = replace(Evidence(table, table.outcomes, np.tile(np.eye(3), (len(table), 1, 1)), evidence.mechanics))
        block = replace(shaped, chosen=later).block
        chosen = np.isin(table.push_id, sorted(later))
        assert len(set(block[chosen])) == 20 and not set(block[chosen]) & set(block[~chosen])
        assert len(set(block[~chosen])) == 100
        taken = replace(shaped, chosen=later).take(chosen)
        assert len(set(taken.block)) == 20


@pytest.mark.slow
def test_pushes_after_a_rest_settle_whether_time_or_distance_drives(
    model: PushModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both grow together until the rest: afterwards time is ahead, and contact friction has followed it."""
    few = [each for each in LIBRARY if each.name in ("contact_friction", "pressure_spread", "tilted_surface")]
    for module in ("candidates.enumeration", "selection.further_steps"):  # responses and steps take most of the time
        monkeypatch.setattr(f"push_predictor.residuals.{module}.LIBRARY", few)
    monkeypatch.setattr("push_predictor.residuals.selection.further_steps.REFINEMENTS", [])
    first, further = pushes(150, 5), pushes(20, 6)
    time = np.concatenate([first.covariates["elapsed_time"], 1500.0 + 0.2 * further.covariates["elapsed_time"]])
    count = np.concatenate([first.covariates["push_index"], 150.0 + further.covariates["push_index"]])
    wobble = 0.01 * np.repeat(np.random.default_rng(0).standard_normal(170), 3)
    columns = {"elapsed_time": time, "push_index": count, "slid_distance": 0.01 * count + wobble}
    both = concatenate([first, further])
    table = replace(both, covariates={**both.covariates, **columns})
    push = Push(table.inputs, table.duration, table.covariates)
    mechanics = evidence_of(model, table).mechanics
    table = replace(table, outcomes=table.outcomes + joint_shift(mechanics, [slippery(0.04)], push))
    every = replace(evidence_of(model, table), chosen=frozenset(further.pushes))
    names = ["elapsed_time", "slid_distance"]
    alone = motion_effects(model, every.take(np.arange(len(first))), 0.01, names)
    assert {alone.terms[0].best.covariate, *alone.equivalent} == {"elapsed_time", "slid_distance"}
    assert {name for proposal in alone.experiment.pushes for name in proposal} >= set(names)
    settled = motion_effects(model, every, 0.01, names)
    assert settled.terms[0].best.label == ("contact_friction", "elapsed_time") and not settled.equivalent
