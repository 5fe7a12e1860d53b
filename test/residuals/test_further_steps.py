# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Constant parameters of an analytical base that are off at once are found together, and nothing next to them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_traces import DRIFT, physics, planted, pushes
from push_predictor.residuals.candidates.coefficients import estimated_effects
from push_predictor.residuals.candidates.parameter_changes import ParameterChanges
from push_predictor.residuals.selection.cross_validation import Judged
from push_predictor.residuals.selection.further_steps import Exchange, worthwhile
from push_predictor.residuals.selection.term_choice import SelectedTerm
from synthetic import square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.ladder import Rung
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import candidate
from push_predictor.residuals.channels.motion import MotionFinding, motion_effects
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of
from push_predictor.residuals.extension.extended_model import extend
from push_predictor.residuals.selection.naming import Naming

CONSTANT = DriverBasis("constant")
COUNT = 100  # pushes, as few as have blocks enough (FEWEST_BLOCKS)
FEW = ("contact_friction", "pressure_spread", "body_anisotropy")
WEAR = DriverBasis("linear", ("elapsed_time",), (0.0,), (1000.0,))  # from nothing at the start


def constant(mechanism: str | None, *coefficients: float) -> Effect:
    return planted(mechanism, "model_inputs", CONSTANT, *coefficients)


LESS_FRICTION = constant("contact_friction", -0.12)
BOTH = LESS_FRICTION, constant("body_anisotropy", 0.0, 0.15)


@pytest.fixture(scope="module")
def deployed() -> PushModel:
    return train_model(pushes(COUNT, 1), square_rig(), "analytical", name="deployed")


@pytest.fixture
def a_library_of_three(monkeypatch: pytest.MonkeyPatch) -> None:
    """Computing responses takes most of the time."""
    library = [mechanism for mechanism in LIBRARY if mechanism.name in FEW]
    monkeypatch.setattr("push_predictor.residuals.candidates.enumeration.LIBRARY", library)


@pytest.fixture
def few_steps(a_library_of_three: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps among six mechanisms: a test of what is found, not of all that a step must not be taken for."""
    names = {"LIBRARY": FEW, "REFINEMENTS": ("friction_by_angle", "outline_shift", "tip_offset")}
    for name, every in (("LIBRARY", LIBRARY), ("REFINEMENTS", REFINEMENTS)):
        few = tuple(mechanism for mechanism in every if mechanism.name in names[name])
        monkeypatch.setattr(f"push_predictor.residuals.selection.further_steps.{name}", few)


def found(model: PushModel, table: PushTable) -> tuple[MotionFinding, dict[Any, tuple[Effect, SelectedTerm]]]:
    """The finding, and its terms with their effects by mechanism."""
    evidence = evidence_of(model, table)
    finding = motion_effects(model, evidence, 0.01, ["elapsed_time"])
    candidates = [term.best for term in finding.terms]
    effects = estimated_effects(evidence, candidates)[0] if candidates else ()
    return finding, {term.best.mechanism: (effect, term) for term, effect in zip(finding.terms, effects, strict=True)}


def within_interval(effect: Effect, truth: Effect) -> bool:
    return bool(np.all(np.abs(effect.coefficients - truth.coefficients) < 2.6 * np.sqrt(np.diag(effect.covariance))))


@pytest.mark.usefixtures("few_steps")
def test_two_constant_changes_at_once_are_both_found_with_their_sizes(deployed: PushModel) -> None:
    _, terms = found(deployed, pushes(COUNT, 5, *BOTH))
    assert set(terms) == {"contact_friction", "body_anisotropy"}
    for truth in BOTH:
        effect, term = terms[truth.mechanism]
        assert within_interval(effect, truth)
        assert term.since_training


@pytest.mark.usefixtures("few_steps")
def test_what_training_has_in_the_same_size_is_no_change_next_to_one_that_is(deployed: PushModel) -> None:
    before = pushes(COUNT, 3, LESS_FRICTION)
    model = train_model(before, square_rig(), "analytical", name="deployed")
    _, terms = found(model, pushes(COUNT, 6, *BOTH))
    assert {name: term.since_training for name, (_, term) in terms.items()} == {
        "contact_friction": False,
        "body_anisotropy": True,
    }


@pytest.mark.usefixtures("few_steps")
def test_a_mechanism_that_only_the_steps_have_is_found_next_to_one_of_the_library(deployed: PushModel) -> None:
    by_angle = constant("friction_by_angle", 0.25)
    _, terms = found(deployed, pushes(COUNT, 7, LESS_FRICTION, by_angle))
    assert set(terms) == {"contact_friction", "friction_by_angle"}
    assert all(term.naming.known for _, term in terms.values())
    assert within_interval(terms["friction_by_angle"][0], by_angle)


@pytest.mark.usefixtures("few_steps")
@pytest.mark.parametrize("seed", [8, 9])
def test_nothing_is_found_where_nothing_changed(deployed: PushModel, seed: int) -> None:
    assert not found(deployed, pushes(COUNT, seed))[0].terms


@pytest.mark.usefixtures("a_library_of_three")
def test_nothing_is_added_to_the_only_effect(deployed: PushModel) -> None:
    finding, _ = found(deployed, pushes(COUNT, 10, LESS_FRICTION))
    assert [term.best.label for term in finding.terms] == [("contact_friction", "model_inputs")]


@pytest.mark.usefixtures("few_steps")
def test_nothing_is_added_to_the_only_effect_along_a_covariate(deployed: PushModel) -> None:
    wear = planted("contact_friction", "elapsed_time", WEAR, 0.15)
    finding, _ = found(deployed, pushes(COUNT, 10, wear))
    assert [term.best.label for term in finding.terms] == [("contact_friction", "elapsed_time")]


@pytest.mark.usefixtures("a_library_of_three")
def test_an_unknown_constant_effect_keeps_no_name(deployed: PushModel) -> None:
    """Sideways motion at every push: no parameter of the mechanics does that."""
    table = pushes(COUNT, 11)
    shifted = replace(table, outcomes=table.outcomes + [0.0, 6e-4, 0.0])
    finding, _ = found(deployed, shifted)
    assert finding.terms[0].best.mechanism is None


# --- the rules ----------------------------------------------------------------------------------------------------


def term_with(evidence: Evidence, mechanism: str | None, basis: DriverBasis, *gains: float) -> SelectedTerm:
    best = candidate(evidence, mechanism, "elapsed_time", basis)
    judged, nothing = Judged(best, np.array(gains)), np.zeros((len(evidence.table), 3))
    return SelectedTerm(best, (judged,), 0.001, np.zeros(1), nothing, 0.5, Naming((), (), True, 0.0), False)


@pytest.mark.parametrize(
    "gains, enough",
    [([1.4] * 4, True), ([1.2] * 4, False), ([18.0, -5.0, -3.0, -3.0], False), ([9.0, 3.0, -2.0, 2.0], True)],
    ids=["over five nats", "under five nats", "by few pushes", "over its standard error"],
)
def test_a_later_effect_must_gain_five_nats_and_its_standard_error(
    deployed: PushModel, gains: list[float], enough: bool
) -> None:
    evidence = evidence_of(deployed, pushes(COUNT, 1))
    assert worthwhile(term_with(evidence, "contact_friction", DRIFT, *gains), evidence) == enough


def test_a_later_effect_must_gain_that_for_each_coefficient_and_an_unknown_constant_one_never_does(
    deployed: PushModel,
) -> None:
    evidence = evidence_of(deployed, pushes(COUNT, 1))
    assert not worthwhile(term_with(evidence, "body_anisotropy", DRIFT, *[2.4] * 4), evidence)
    assert worthwhile(term_with(evidence, "body_anisotropy", DRIFT, *[2.6] * 4), evidence)
    assert not worthwhile(term_with(evidence, None, CONSTANT, *[100.0] * 4), evidence)


@pytest.mark.parametrize(
    "added, dropped, gain, error, accepted",
    [
        ("outline_x", "centre_x", 9.0, 1.0, False),
        ("outline_x", "centre_x", 11.0, 1.0, True),
        ("outline_x", "centre_x", 11.0, 12.0, False),
        ("centre_y", "centre_x", 3.0, 1.0, True),
        ("outline_x", "outline_y", 3.0, 1.0, True),
    ],
)
def test_a_refinement_replaces_a_mechanism_of_the_library_only_for_as_much_as_both_must_gain(
    added: str, dropped: str, gain: float, error: float, accepted: bool
) -> None:
    rung: Any = Rung(None, (added,), (dropped,), gain, error)  # type: ignore[arg-type]  # the rule does not see the fit
    assert Exchange([("centre_x",), ("centre_y",)], 100).accepts(rung) == accepted


# --- the refinements and the parameters of the fit ------------------------------------------------------------------


def test_changes_of_parameters_displace_as_the_effects_do(deployed: PushModel) -> None:
    effects = [
        planted("contact_friction", "elapsed_time", DRIFT, 0.1),
        constant("centre_of_friction", 0.002, -0.001),
    ]
    evidence = evidence_of(deployed, pushes(30, 2))
    changes = ParameterChanges.of(evidence, [candidate(evidence, e.mechanism, e.covariate, e.basis) for e in effects])
    values = {
        name: float(value)
        for group, effect in zip(changes.groups, effects, strict=True)
        for name, value in zip(group, effect.coefficients, strict=True)
    }
    rows = changes.rows()
    twice = [np.concatenate([array, array]) for array in (rows.inputs, rows.duration)]
    given = {name: np.tile(column, 2) for name, column in rows.covariates.items()}
    moved = changes.displacement(values, *twice, given) - changes.displacement({}, *twice, given)
    expected = joint_shift(evidence.mechanics, effects, evidence.push)
    assert np.linalg.norm(moved - np.concatenate([expected, expected])) < 5e-3 * np.linalg.norm(moved)
    assert np.allclose(rows.outcomes - changes.displacement({}, *twice, given)[: len(expected)], evidence.residual)


@pytest.mark.parametrize("mechanism", REFINEMENTS, ids=lambda m: m.name)
def test_an_effect_of_a_refinement_is_its_response(mechanism: Any) -> None:
    table = pushes(20, 2)
    push, mechanics = Push(table.inputs, table.duration, table.covariates), physics()
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
