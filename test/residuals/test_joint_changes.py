# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Constant parameters of an analytical base that are off at once are found together, and nothing next to them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_traces import physics, planted, pushes
from synthetic import square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanisms import REFINEMENTS
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import candidate
from push_predictor.residuals.candidates.joint_fit import FitRows, estimated, fitted
from push_predictor.residuals.channels.motion import MotionFinding, MotionTerm, motion_effects
from push_predictor.residuals.evidence.standardised import evidence_of
from push_predictor.residuals.extension.extended_model import extend

CONSTANT = DriverBasis("constant")
COUNT = 100  # pushes, as few as have blocks enough (FEWEST_BLOCKS)
# Three mechanisms of the library and three refinements.
# Three mechanisms of the library and three refinements.
TRIED = ("contact_friction", "pressure_spread", "body_anisotropy", "friction_by_angle", "outline_shift", "tip_offset")
WEAR = DriverBasis("linear", ("elapsed_time",), (0.0,), (1000.0,))  # from nothing at the start


def constant(mechanism: str | None, *coefficients: float) -> Effect:
    return planted(mechanism, "model_inputs", CONSTANT, *coefficients)


LESS_FRICTION = constant("contact_friction", -0.12)
BOTH = LESS_FRICTION, constant("body_anisotropy", 0.0, 0.15)


def found(model: PushModel, table: PushTable) -> tuple[MotionFinding, dict[Any, tuple[Effect, MotionTerm]]]:
    """The finding, and its terms with their effects by mechanism."""
    evidence = evidence_of(model, table)
    finding = motion_effects(model, evidence, 0.01, ["elapsed_time"])
    effects = estimated(fitted(FitRows(evidence), [term.best for term in finding.terms]))[0] if finding.terms else ()
    return finding, {term.mechanism: (effect, term) for term, effect in zip(finding.terms, effects, strict=True)}


def within_interval(effect: Effect, truth: Effect) -> bool:
    return bool(np.all(np.abs(effect.coefficients - truth.coefficients) < 2.6 * np.sqrt(np.diag(effect.covariance))))


def test_two_constant_changes_at_once_are_both_found_with_their_sizes(deployed: PushModel) -> None:
    _, terms = found(deployed, pushes(COUNT, 5, *BOTH))
    assert set(terms) == {"contact_friction", "body_anisotropy"}
    for truth in BOTH:
        effect, term = terms[truth.mechanism]
        assert within_interval(effect, truth)
        assert term.since_training


def test_what_training_has_in_the_same_size_is_no_change_next_to_one_that_is(deployed: PushModel) -> None:
    before = pushes(COUNT, 3, LESS_FRICTION)
    model = train_model(before, square_rig(), "analytical", name="deployed")
    _, terms = found(model, pushes(COUNT, 6, *BOTH))
    assert {name: term.since_training for name, (_, term) in terms.items()} == {
        "contact_friction": False,
        "body_anisotropy": True,
    }


def test_a_refinement_is_found_next_to_a_mechanism_of_the_library(deployed: PushModel) -> None:
    by_angle = constant("friction_by_angle", 0.25)
    _, terms = found(deployed, pushes(COUNT, 7, LESS_FRICTION, by_angle))
    assert set(terms) == {"contact_friction", "friction_by_angle"}
    assert all(term.naming.known for _, term in terms.values())
    assert within_interval(terms["friction_by_angle"][0], by_angle)


@pytest.mark.parametrize("only", [LESS_FRICTION, planted("contact_friction", "elapsed_time", WEAR, 0.15)])
def test_nothing_is_added_to_the_only_effect(deployed: PushModel, only: Effect) -> None:
    finding, _ = found(deployed, pushes(COUNT, 10, only))
    assert [term.best.label for term in finding.terms] == [("contact_friction", only.covariate)]


def test_an_unknown_constant_effect_keeps_no_name(deployed: PushModel) -> None:
    """Sideways motion at every push: no parameter of the mechanics does that."""
    table = pushes(COUNT, 11)
    shifted = replace(table, outcomes=table.outcomes + [0.0, 6e-4, 0.0])
    finding, _ = found(deployed, shifted)
    assert finding.terms[0].best.mechanism is None


# --- the refinements ------------------------------------------------------------------


@pytest.mark.parametrize("mechanism", REFINEMENTS, ids=lambda m: m.name)
def test_an_effect_of_a_refinement_is_its_response(mechanism: Any) -> None:
    table = pushes(8, 2)
    push, mechanics = Push.of(table), physics()
    if mechanism.name == "rim_pressure":  # of a patch
        mechanics = FittedMechanics(PushMechanics(mechanics.outline, mechanics.mechanics.pusher_radius))
    sizes = 0.5 * np.array([BY_NAME[name].spread for name in mechanism.quantities])
    more, less = (joint_shift(mechanics, [constant(mechanism.name, *size)], push) for size in (sizes, -sizes))
    expected = mechanism.response(mechanics, push) @ sizes
    assert np.linalg.norm(expected) > 0.0
    assert np.linalg.norm(0.5 * (more - less) - expected) < 0.02 * np.linalg.norm(expected)


def test_a_model_with_a_refinement_is_saved_and_loaded(deployed: PushModel, tmp_path: Path) -> None:
    evidence = evidence_of(deployed, pushes(40, 2, constant("friction_by_angle", 0.25)))
    model = extend(deployed, evidence, [candidate(evidence, "friction_by_angle", "model_inputs", CONSTANT)])
    save_model(model, tmp_path / "refined.pushmodel")
    again, table = load_model(tmp_path / "refined.pushmodel"), evidence.table
    first, second = (m.predict_rows(table.inputs, table.duration, table.covariates) for m in (model, again))
    assert np.allclose(first.mean, second.mean)
    assert not np.allclose(first.mean, deployed.predict_rows(table.inputs, table.duration).mean, atol=1e-6)
