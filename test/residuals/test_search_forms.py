# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A planted effect is found in its form: step, line, growth or constant, and with the place of its onset."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from search_bench import gate_of, in_library, search_with
from square_session import (
    COUNT,
    DRIVERS,
    EXACT,
    FOUR,
    baseline,
    learnt,
    linear,
    pushes,
    searched,
    seen,
    with_effect,
)

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.residuals.candidates.candidate import candidates_of

ALWAYS = DriverBasis("constant")


@pytest.fixture(autouse=True)
def a_library_of_four(monkeypatch: pytest.MonkeyPatch) -> None:
    """Computing responses takes most of the time."""
    in_library(monkeypatch, *FOUR)


def sets_in(place: float) -> DriverBasis:
    return DriverBasis("step", ("elapsed_time",), place=place)


def test_step_is_found_with_its_place() -> None:
    table = with_effect(pushes(COUNT, 300), "contact_friction", sets_in(600.0), 0.25)
    basis = searched(learnt(), table).terms[0].best.basis
    assert basis.name == "step"
    assert basis.place == pytest.approx(600.0, abs=75.0)


def test_large_effect_that_sets_in_early_is_one_step_of_every_covariate_that_has_it() -> None:
    """On mechanics, which absorb no constant effect, most of it looks constant."""
    plain, late = pushes(200, 302), sets_in(305.0)
    after = late.values(plain.covariates, len(plain))[:, 0]
    plain = replace(plain, covariates={**plain.covariates, "topic:/valve": 20.0 + 5.0 * after})
    table = with_effect(plain, "contact_friction", late, 0.35)
    (term,) = searched(EXACT, table, drivers=[*DRIVERS, "topic:/valve"]).terms
    assert (term.mechanism, term.best.basis.name) == ("contact_friction", "step")
    assert set(term.naming.covariates) == {"elapsed_time", "topic:/valve"}


def test_an_effect_that_is_there_from_the_first_push_is_constant() -> None:
    table = with_effect(pushes(COUNT, 302), "contact_friction", ALWAYS, 0.15)
    (term,) = searched(EXACT, table).terms
    assert term.best.label == ("contact_friction", "model_inputs")
    assert term.naming.covariates == ("model_inputs",)


def test_an_effect_that_soon_has_its_full_size_may_be_constant_or_have_grown() -> None:
    plain = pushes(COUNT, 302)
    time, whole = plain.covariates["elapsed_time"], with_effect(plain, "contact_friction", ALWAYS, 0.15)
    reached = 1.0 - np.exp(-(time - time.min()) / (0.07 * np.ptp(time)))
    outcomes = plain.outcomes + reached[:, None] * (whole.outcomes - plain.outcomes)
    (term,) = searched(EXACT, replace(plain, outcomes=outcomes)).terms
    assert term.mechanism == "contact_friction"
    assert "elapsed_time" in term.naming.covariates
    assert set(term.naming.covariates) <= {"model_inputs", "elapsed_time"}


def test_onset_of_an_effect_that_is_fixed_to_the_world_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slope that is there from the 13th of 100 pushes on looks constant, too."""
    table = with_effect(pushes(COUNT, 302), "tilted_surface", sets_in(125.0), 0.2, -0.1)
    in_library(monkeypatch, "contact_friction", "tilted_surface")
    (term,) = searched(EXACT, table).terms
    assert (term.best.label, term.best.basis.name) == (("tilted_surface", "elapsed_time"), "step")
    assert term.best.basis.place == pytest.approx(125.0, abs=25.0)


def test_constant_effect_that_the_inputs_express_in_part_has_no_onset() -> None:
    """An onset before almost all pushes is the constant effect."""
    table = with_effect(pushes(COUNT, 303), "centre_of_friction", ALWAYS, 0.015, 0.0)
    evidence = seen(EXACT, table)
    gate = gate_of(EXACT, evidence, DRIVERS, baseline=baseline(EXACT))
    sides = table.covariates["edge"][:, None] == np.arange(3)  # they explain a part of the effect
    folded = replace(gate.inputs, folds=True, columns=np.column_stack([gate.inputs.columns, sides]))
    gate = replace(gate, candidates=tuple(candidates_of(evidence, DRIVERS, folded)), inputs=folded)
    first = search_with(EXACT, gate).terms[0]
    assert (first.mechanism, first.best.basis.is_constant) == ("centre_of_friction", True)


def test_linear_dependence_keeps_its_covariate_and_mostly_stays_linear() -> None:
    forms = []
    for seed in (400, 401, 402):
        plain = pushes(COUNT, seed)
        table = with_effect(plain, "contact_friction", linear(plain, "slider_x"), 0.08)
        (term,) = searched(learnt(), table).terms
        assert (term.best.label, term.naming.covariates) == (("contact_friction", "slider_x"), ("slider_x",))
        forms.append(term.best.basis.name)
    assert forms.count("linear") >= 2


def test_an_effect_that_grows_with_time_grows_from_nothing_at_the_start() -> None:
    plain = pushes(COUNT, 304)
    time = plain.covariates["elapsed_time"]
    grows = DriverBasis("linear", ("elapsed_time",), (float(time.min()),), (float(np.ptp(time)),))
    (term,) = searched(EXACT, with_effect(plain, "contact_friction", grows, 0.3)).terms
    assert (term.best.label, term.best.basis.name) == (("contact_friction", "elapsed_time"), "linear")
    assert not term.best.basis.offset


@pytest.mark.parametrize(
    ("name", "coefficients"), [("periodic", (0.12, 0.06)), ("periodic, twice around", (0.12, 0.06))]
)
def test_an_effect_of_the_heading_is_found_with_its_period(name: str, coefficients: tuple[float, ...]) -> None:
    basis = DriverBasis(name, ("slider_heading",))
    (term,) = searched(EXACT, with_effect(pushes(COUNT, 305), "contact_friction", basis, *coefficients)).terms
    assert (term.best.label, term.best.basis.name) == (("contact_friction", "slider_heading"), name)
