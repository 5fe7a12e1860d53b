# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Planted effects get the names of their mechanism and covariate, and unknown ones that of their covariate alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from search_bench import in_library
from square_session import (
    ANALYTICAL,
    COUNT,
    DRIVERS,
    FOUR,
    NOISE,
    learnt,
    linear,
    pushes,
    searched,
    with_effect,
)

from push_predictor.models.effects.driver_basis import DriverBasis


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
            ("pressure_spread", "elapsed_time", [0.15]),
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

    def test_constant_change_lies_in_the_inputs_of_the_model(self) -> None:
        table = with_effect(pushes(COUNT, 203), "contact_friction", DriverBasis("constant"), 0.12)
        assert searched(learnt(), table).terms[0].best.label == ("contact_friction", "model_inputs")

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
