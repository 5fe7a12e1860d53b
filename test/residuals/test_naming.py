# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Rivals within chance remain possible, and a mechanism gives its name only to what it explains."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from made_up_traces import DRIFT, pushes
from synthetic import square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.train import train_model
from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.candidates.joint_fit import Fit
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of
from push_predictor.residuals.selection.naming import (
    REJECTED,
    Naming,
    Trial,
    chosen_of,
    naming_of,
    surely,
    unexplained_share,
)

BLOCKS = 100
ALWAYS = DriverBasis("constant")
UNEVEN = np.where(np.arange(BLOCKS) % 2, 1.0, -1.0)  # of a sum: a standard error of 10
EVEN = np.ones(BLOCKS) / BLOCKS


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    table = pushes(20, 1)
    return evidence_of(train_model(table, square_rig(), "analytical", name="deployed"), table)


def made(
    evidence: Evidence,
    mechanism: str | None,
    covariate: str,
    scores: np.ndarray,
    *,
    more: Any = 0.0,
    first: Any = 0.0,
    basis: DriverBasis = DRIFT,
) -> Trial:
    """A trial with these scores (b,) of blocks.

    more, first: what the generic polynomial and the mechanism itself in the first windows gain next to it.
    """

    def with_columns(columns: np.ndarray) -> np.ndarray:
        return np.asarray(scores + (first if columns.shape[2] == 1 else more))

    fit = SimpleNamespace(rows=SimpleNamespace(evidence=evidence), scores=scores, with_columns=with_columns)
    return Trial(Candidate(mechanism, covariate, basis, np.ones((1, 3, 1))), cast("Fit", fit))


def base(gain: float = 0.0) -> Fit:
    return cast("Fit", SimpleNamespace(scores=gain * EVEN))


@pytest.mark.parametrize(("advantage", "kept"), [(-5.0, True), (20.0, True), (25.0, False)])
@pytest.mark.parametrize("other", [("contact_friction", "push_index"), ("pressure_spread", "elapsed_time")])
def test_a_covariate_or_mechanism_remains_unless_it_is_worse_by_more_than_chance(
    evidence: Evidence, other: tuple[str, str], advantage: float, kept: bool
) -> None:
    """2.33 standard errors of 10 nats."""
    chosen = made(evidence, "contact_friction", "elapsed_time", 500.0 * EVEN)
    found = naming_of(chosen, [made(evidence, *other, (500.0 - advantage) * EVEN + UNEVEN)], base())
    possible = zip(*{("contact_friction", "elapsed_time"): None, **({other: None} if kept else {})}, strict=True)
    assert (found.mechanisms, found.covariates) == tuple(tuple(dict.fromkeys(names)) for names in possible)


@pytest.mark.parametrize("first", ["elapsed_time", "push_index"])
def test_covariates_that_are_one_in_other_units_remain_whatever_the_rounding(evidence: Evidence, first: str) -> None:
    chosen = made(evidence, "contact_friction", first, (500.0 + 1e-9) * EVEN)
    (other,) = {"elapsed_time", "push_index"} - {first}
    rival = made(evidence, "contact_friction", other, 500.0 * EVEN)
    assert set(naming_of(chosen, [rival], base()).covariates) == {first, other}


def test_rivals_are_the_best_first_and_each_once(evidence: Evidence) -> None:
    chosen = made(evidence, "contact_friction", "elapsed_time", 500.0 * EVEN)
    others = [
        made(evidence, mechanism, covariate, (500.0 - behind) * EVEN + UNEVEN)
        for mechanism, covariate, behind in (
            ("pressure_spread", "push_index", 9.0),
            ("contact_friction", "slid_distance", 3.0),
            ("contact_friction", "push_index", 1.0),
        )
    ]
    found = naming_of(chosen, others, base())
    assert found.covariates == ("elapsed_time", "push_index", "slid_distance")
    assert found.mechanisms == ("contact_friction",)  # the other one is a rival of another covariate alone


@pytest.mark.parametrize(("more", "known"), [(10.0, True), (85.0, True), (95.0, False)])
def test_a_name_stays_if_the_polynomial_explains_at_most_15_percent(
    evidence: Evidence, more: float, known: bool
) -> None:
    """85 of 585 nats are 14.5 %, 95 of 595 are 16 %."""
    chosen = made(evidence, "tilted_surface", "elapsed_time", 500.0 * EVEN, more=more * EVEN)
    assert unexplained_share(chosen, base()) == pytest.approx(more / (500.0 + more))
    found = naming_of(chosen, [], base())
    unknown = Naming(("elapsed_time",), (None,), False, "tilted_surface")
    assert found == (Naming(("elapsed_time",), ("tilted_surface",), True) if known else unknown)


@pytest.mark.parametrize(("more", "first"), [(200.0, 10.0), (10.0, 200.0), (0.0, 200.0)])
def test_a_name_goes_by_whatever_the_mechanism_cannot_do(evidence: Evidence, more: float, first: float) -> None:
    chosen = made(evidence, "tilted_surface", "elapsed_time", 500.0 * EVEN, more=more * EVEN, first=first * EVEN)
    assert unexplained_share(chosen, base()) == pytest.approx(200.0 / 700.0)
    assert not naming_of(chosen, [], base()).known


def test_a_name_is_not_withdrawn_for_what_may_be_chance(evidence: Evidence) -> None:
    chosen = made(evidence, "tilted_surface", "elapsed_time", 50.0 * EVEN, more=20.0 * EVEN + UNEVEN)
    assert unexplained_share(chosen, base()) == 0.0
    assert naming_of(chosen, [], base()).known


def test_what_others_explain_is_no_gain_of_the_mechanism(evidence: Evidence) -> None:
    chosen = made(evidence, "tilted_surface", "elapsed_time", 500.0 * EVEN, more=50.0 * EVEN)
    assert unexplained_share(chosen, base(400.0)) == pytest.approx(50.0 / 150.0)
    assert unexplained_share(chosen, base(600.0)) == 1.0  # the mechanism gains nothing


def test_an_unknown_effect_resembles_the_mechanism_that_comes_closest(evidence: Evidence) -> None:
    chosen = made(evidence, None, "elapsed_time", 500.0 * EVEN)
    tried = [made(evidence, name, "elapsed_time", gain * EVEN)
             for name, gain in (("tilted_surface", 50.0), ("contact_friction", 90.0), (None, 95.0))]  # fmt: skip
    assert naming_of(chosen, tried, base()) == Naming(("elapsed_time",), (None,), False, "contact_friction")
    assert naming_of(chosen, [], base()).resembles is None


@pytest.mark.parametrize(("advantage", "constant"), [(20.0, True), (25.0, False)])
def test_an_effect_is_constant_unless_one_that_changes_is_surely_better(
    evidence: Evidence, advantage: float, constant: bool
) -> None:
    changes = made(evidence, "contact_friction", "elapsed_time", 500.0 * EVEN)
    always = made(evidence, "contact_friction", "model_inputs", (500.0 - advantage) * EVEN + UNEVEN, basis=ALWAYS)
    other = made(evidence, "pressure_spread", "model_inputs", 499.0 * EVEN, basis=ALWAYS)
    assert chosen_of([other, always, changes]) is (always if constant else changes)


def test_of_effects_that_change_the_one_that_gains_most_is_chosen(evidence: Evidence) -> None:
    one, other = (made(evidence, "contact_friction", name, gain * EVEN) for name, gain in (("x", 50.0), ("y", 51.0)))
    assert chosen_of([one, other]) is other


@pytest.mark.parametrize(("more", "possible"), [(15.0, True), (5.0, False)])
def test_a_constant_effect_may_have_changed_if_that_gains_more_than_its_error(
    evidence: Evidence, more: float, possible: bool
) -> None:
    """A standard error of 10 nats."""
    always = made(evidence, "contact_friction", "model_inputs", 500.0 * EVEN, basis=ALWAYS)
    early = made(evidence, "contact_friction", "elapsed_time", (500.0 + more) * EVEN + UNEVEN)
    assert ("elapsed_time" in naming_of(always, [early], base()).covariates) == possible


@pytest.mark.parametrize(("level", "sure"), [(0.05, True), (0.01, True), (0.05 / 12, False)])
def test_a_gain_of_two_and_a_half_standard_errors(level: float, sure: bool) -> None:
    assert surely(UNEVEN + 25.0 * EVEN, level) == sure


def test_no_gain_is_never_sure() -> None:
    assert not surely(np.zeros(BLOCKS), REJECTED)
    assert not surely(-EVEN, REJECTED)
