# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A mechanism gives its name to an effect only if its exact fit leaves little along what the mechanism depends on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from push_predictor.residuals.selection.absolute_fit import left_by, parts_of_others, with_fitting_names
from push_predictor.residuals.selection.cross_validation import Judged
from push_predictor.residuals.selection.term_choice import SelectedTerm

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.selection.naming import Naming


def term(
    mechanism: str | None,
    covariate: str,
    gain: float,
    *,
    rivals: Sequence[str] = (),
    resembles: str | None = None,
    basis: str = "linear",
) -> SelectedTerm:
    """A term that gains as much; resembles: for an unknown effect, whose model is the polynomial."""
    best = Candidate(mechanism, covariate, DriverBasis(basis, (covariate,)), np.ones((1, 3, 1)))
    naming = Naming((covariate, *rivals), (mechanism,), mechanism is not None, 0.0, resembles)
    return SelectedTerm(best, (Judged(best, np.array([gain])),), 0.001, np.ones(1), np.ones((1, 3)), 0.1, naming, False)


def names(terms: Sequence[SelectedTerm]) -> list[tuple[str | None, str | None]]:
    """Name and resemblance of each term."""
    return [(t.mechanism, t.naming.resembles) for t in with_fitting_names(terms)]


SLOPE = ("tilted_surface", None)
UNKNOWN_SLOPE = (None, "tilted_surface")


def test_name_stays_if_nothing_else_is_found() -> None:
    assert names([term("tilted_surface", "push_index", 300.0)]) == [SLOPE]


def test_mechanism_that_is_fixed_to_the_world_must_fit_at_every_heading() -> None:
    """A cable pulls with another direction at each place, so a slope leaves much that depends on the heading."""
    for heading in ("slider_heading", "push_heading"):
        found = [term("tilted_surface", "push_index", 300.0), term(None, heading, 100.0)]
        assert names(found) == [UNKNOWN_SLOPE, (None, None)]


def test_mechanism_that_is_fixed_to_the_slider_need_not() -> None:
    found = [term("contact_friction", "push_index", 300.0), term(None, "slider_heading", 100.0)]
    assert names(found)[0] == ("contact_friction", None)


def test_name_must_fit_along_every_covariate_that_may_drive_it() -> None:
    found = [term("contact_friction", "push_index", 300.0, rivals=["elapsed_time"]), term(None, "elapsed_time", 100.0)]
    assert names(found)[0] == (None, "contact_friction")
    other = [term("contact_friction", "push_index", 300.0), term(None, "elapsed_time", 100.0)]
    assert names(other)[0] == ("contact_friction", None)


def test_name_is_withdrawn_from_a_rest_of_15_percent() -> None:
    """It stays with at most 15 % of both gains, as along the mechanism's own covariate."""
    small, large = ([term("tilted_surface", "push_index", 85.0), term(None, "slider_heading", g)] for g in (14.0, 16.0))
    assert names(small)[0] == SLOPE
    assert names(large)[0] == UNKNOWN_SLOPE


def test_what_was_found_before_is_no_rest() -> None:
    found = [term(None, "slider_heading", 100.0), term("tilted_surface", "push_index", 300.0)]
    assert names(found) == [(None, None), SLOPE]


def test_second_term_of_a_mechanism_that_does_not_fit_has_no_name_either() -> None:
    found = [
        term("tilted_surface", "push_index", 300.0),
        term(None, "slider_heading", 100.0),
        term("tilted_surface", "slider_y", 50.0),
    ]
    assert names(found).count(UNKNOWN_SLOPE) == 2
    assert SLOPE not in names(found)


def test_model_keeps_the_response_of_a_mechanism_without_its_name() -> None:
    first = with_fitting_names([term("tilted_surface", "push_index", 300.0), term(None, "push_heading", 100.0)])[0]
    assert (first.best.mechanism, first.naming.mechanisms) == ("tilted_surface", (None,))


def test_unknown_effect_resembles_the_same_whatever_is_found_later() -> None:
    found = [term(None, "push_index", 300.0, resembles="tilted_surface"), term(None, "push_heading", 100.0)]
    assert names(found) == [UNKNOWN_SLOPE, (None, None)]


def test_rest_of_an_effect_comes_after_other_effects() -> None:
    found = [
        term("tilted_surface", "push_index", 300.0),
        term(None, "slider_heading", 10.0),
        term("contact_friction", "topic:/temperature", 50.0),
    ]
    assert [t.best.covariate for t in with_fitting_names(found)] == [
        "push_index",
        "topic:/temperature",
        "slider_heading",
    ]


def test_rest_of_an_effect_is_no_effect_of_its_own() -> None:
    slope = term("tilted_surface", "push_index", 300.0)
    assert left_by(slope, term(None, "slider_heading", 10.0))
    assert not left_by(slope, term(None, "topic:/temperature", 10.0))
    assert not left_by(slope, term(None, "model_inputs", 10.0))
    assert not left_by(slope, term("anisotropic_friction", "push_heading", 10.0))


def test_constant_part_of_an_effect_is_no_effect_of_its_own() -> None:
    changing = term("centre_of_friction", "velocity", 300.0)
    constant = term("centre_of_friction", "edge", 50.0, basis="constant")
    temperature = term("centre_of_friction", "topic:/temperature", 50.0)
    other = term("pressure_spread", "edge", 20.0, basis="constant")
    assert parts_of_others([changing, constant, temperature, other]) == [False, True, True, False]
    large = term("centre_of_friction", "topic:/temperature", 60.0)
    assert parts_of_others([changing, constant, large, other]) == [False, True, False, False]
    assert [t.best.covariate for t in with_fitting_names([changing, constant, large])][-1] == "edge"
    assert names([changing, constant]) == 2 * [("centre_of_friction", None)]


def test_constant_effect_that_also_changes_is_the_changing_one() -> None:
    """That part tells what the effect depends on."""
    always = term("centre_of_friction", "edge", 300.0, basis="constant")
    other, later = (
        term("contact_friction", "session", 90.0, basis="constant"),
        term("centre_of_friction", "velocity", 20.0),
    )
    found = with_fitting_names([always, other, later])
    assert [t.best.covariate for t in found] == ["velocity", "session", "edge"]
    assert parts_of_others(found) == [False, False, True]
    assert [t.best.covariate for t in with_fitting_names([always, other])] == ["edge", "session"]
    before = term("contact_friction", "velocity", 20.0)
    assert [t.best.covariate for t in with_fitting_names([before, other])] == ["velocity", "session"]


def test_map_in_two_terms_is_one_effect() -> None:
    found = [term("tilted_surface", "slider_x", 300.0), term("tilted_surface", "slider_x", 50.0, basis="quadratic")]
    assert parts_of_others(found) == [False, True]


def test_rest_of_an_unknown_effect_is_no_effect_of_its_own() -> None:
    unknown = term(None, "push_index", 300.0, resembles="tilted_surface")
    assert left_by(unknown, term(None, "slider_heading", 10.0))
    assert left_by(unknown, term(None, "model_inputs", 10.0))
    assert left_by(unknown, term("tilted_surface", "slider_y", 10.0))
    assert left_by(unknown, term(None, "slider_y", 10.0, resembles="tilted_surface"))
    assert not left_by(unknown, term(None, "slider_y", 10.0))
    assert not left_by(unknown, term("contact_friction", "push_index", 10.0))


def test_unknown_effects_that_resemble_nothing_differ_by_their_covariates() -> None:
    unknown = term(None, "push_index", 300.0)
    assert left_by(unknown, term(None, "push_index", 10.0))
    assert not left_by(unknown, term(None, "slider_y", 10.0))
