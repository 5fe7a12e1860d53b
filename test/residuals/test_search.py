# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Planted effects are found with the name of their mechanism and covariate, in their form, and with their onset."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from search_bench import gate_of, in_library, search_with
from square_session import (
    ANALYTICAL,
    COUNT,
    DRIVERS,
    EXACT,
    FOUR,
    NOISE,
    WINDOWS,
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


@pytest.fixture(autouse=True)
def a_library_of_four(monkeypatch: pytest.MonkeyPatch) -> None:
    """Computing responses takes most of the time."""
    in_library(monkeypatch, *FOUR)


class TestNames:
    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("mechanism", "driver", "coefficients"),
        [
            ("contact_friction", "topic:/temperature", [0.08]),
            ("centre_of_friction", "slider_x", [0.003, 0.002]),
        ],
    )
    def test_planted_effect_gets_its_mechanism_and_covariate(
        self, mechanism: str, driver: str, coefficients: list[float]
    ) -> None:
        plain = pushes(COUNT, 200)
        found = searched(learnt(), with_effect(plain, mechanism, linear(plain, driver), *coefficients))
        first = found.terms[0]
        assert first.best.label == (mechanism, driver)
        assert first.naming.known
        assert driver in first.naming.covariates
        assert first.p_value <= 0.01

    def test_anisotropy_of_the_table_depends_on_the_push_heading(self) -> None:
        table = with_effect(pushes(COUNT, 201), "anisotropic_friction", DriverBasis("constant"), 0.2, 0.1)
        first = searched(learnt(), table).terms[0]
        assert first.best.label == ("anisotropic_friction", "push_heading")

    def test_shifted_centre_of_friction_depends_on_the_folded_sides(self) -> None:
        table = with_effect(pushes(COUNT, 202), "centre_of_friction", DriverBasis("constant"), 0.003, 0.002)
        assert searched(learnt(), table).terms[0].best.label == ("centre_of_friction", "edge")

    def test_analytical_model_finds_a_different_contact_friction(self) -> None:
        found = searched(ANALYTICAL, pushes(COUNT, 204), drivers=())
        assert found.terms[0].best.label == ("contact_friction", "model_inputs")
        assert found.fit.coefficients[0] == pytest.approx(0.25 - 0.3, abs=0.02)

    @pytest.mark.slow
    def test_effect_outside_the_library_gets_its_covariate_and_no_mechanism(self) -> None:
        """Asymmetric slip grows with temperature, but the library contains only two other mechanisms."""
        plain = pushes(COUNT, 205)
        table = with_effect(plain, "contact_asymmetry", linear(plain, "topic:/temperature"), 0.2)
        first = searched(learnt(), table, mechanisms=["pressure_spread", "centre_of_friction"]).terms[0]
        assert first.best.label == (None, "topic:/temperature")
        assert not first.naming.known

    @pytest.mark.slow
    def test_effect_like_a_mechanism_is_modelled_as_this_but_not_named_after_it(self) -> None:
        """Contact friction grows with temperature, and so does a drift to one side that it cannot explain."""
        plain = pushes(COUNT, 207)
        warm = linear(plain, "topic:/temperature")
        table = with_effect(plain, "contact_friction", warm, 0.2)
        drift = np.outer(4.0 * warm.values(plain.covariates, len(plain)), [0.0, NOISE[1], 0.0])
        first = searched(learnt(), replace(table, outcomes=table.outcomes + drift)).terms[0]
        assert first.best.covariate == "topic:/temperature"
        assert (first.mechanism, first.naming.resembles) == (None, "contact_friction")

    @pytest.mark.parametrize("passes", [False, True])
    def test_effect_that_passes_as_the_slider_moves_is_not_named_after_a_mechanism(self, passes: bool) -> None:
        """The contact is more slippery, in all windows of a push or in the first only."""
        plain = pushes(COUNT, 208)
        since = np.resize(0.2 * np.arange(WINDOWS), len(plain))
        timed = replace(plain, covariates={**plain.covariates, "time_since_contact": since})
        table = with_effect(timed, "contact_friction", DriverBasis("constant"), -0.15)
        if passes:
            table = replace(table, outcomes=np.where(since[:, None] > 0.0, plain.outcomes, table.outcomes))
        first = searched(ANALYTICAL, table, drivers=()).terms[0]
        assert first.best.mechanism == "contact_friction"
        assert (first.mechanism is None) == passes
        assert first.naming.resembles == ("contact_friction" if passes else None)

    @pytest.mark.slow
    def test_correlated_covariates_stay_undecided(self) -> None:
        plain = pushes(COUNT, 206)
        twins = {**plain.covariates, "slid_distance": 0.003 * plain.covariates["elapsed_time"] + 0.001}
        table = with_effect(replace(plain, covariates=twins), "contact_friction", linear(plain, "elapsed_time"), 0.08)
        naming = searched(learnt(), table, drivers=(*DRIVERS, "slid_distance")).terms[0].naming
        assert set(naming.covariates) == {"elapsed_time", "slid_distance"}
        assert naming.mechanisms[0] == "contact_friction"


def test_what_a_polynomial_leaves_of_an_unknown_effect_is_no_effect_of_its_own() -> None:
    table = pushes(COUNT, 310)
    lopsided = 1.5 * NOISE[0] * (1.0 + np.cos(table.covariates["slider_heading"]))
    pulled = replace(table, outcomes=table.outcomes + np.outer(lopsided, [1.0, 0.0, 0.0]))
    found = searched(ANALYTICAL, pulled, mechanisms=())
    assert [term.best.label for term in found.terms] == [(None, "slider_heading")]


# --- forms ------------------------------------------------------------------------------------------------------------


ALWAYS = DriverBasis("constant")


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


def test_linear_dependence_keeps_its_covariate_and_stays_linear() -> None:
    forms = []
    for seed in (400, 401):
        plain = pushes(COUNT, seed)
        table = with_effect(plain, "contact_friction", linear(plain, "slider_x"), 0.08)
        (term,) = searched(learnt(), table).terms
        assert (term.best.label, term.naming.covariates) == (("contact_friction", "slider_x"), ("slider_x",))
        forms.append(term.best.basis.name)
    assert forms == ["linear"] * 2


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
