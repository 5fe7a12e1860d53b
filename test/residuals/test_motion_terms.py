# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Effects on the motion: the moves that undo a wrong choice, and the terms that are left: parts, outputs, shares."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from made_up_traces import NOISE, planted, pushes, slippery
from search_bench import gate_of
from synthetic import noisy_pushes, square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import Candidate, candidate
from push_predictor.residuals.candidates.joint_fit import Fit, FitRows
from push_predictor.residuals.channels.motion import MotionTerm, _as_one, _differ, _is_left, _separable, motion_effects
from push_predictor.residuals.evidence.drivers import standard_basis
from push_predictor.residuals.evidence.standardised import evidence_of
from push_predictor.residuals.selection.gate import Gate
from push_predictor.residuals.selection.naming import Naming
from push_predictor.residuals.selection.search import Term, _Search

TRIED = ("contact_friction", "pressure_spread")
ALWAYS = DriverBasis("constant")
ALONG_X = DriverBasis("linear", ("slider_x",), (0.0,), (0.1,))


def found(model: PushModel, table: PushTable) -> tuple[MotionTerm, ...]:
    return motion_effects(model, evidence_of(model, table), 0.01, ["elapsed_time", "slider_x"]).terms


@pytest.mark.parametrize(("friction", "spread"), [(0.1, 0.1), (0.3, 0.06)], ids=["alike", "one far larger"])
def test_two_effects_of_other_mechanisms_and_covariates_are_two(
    deployed: PushModel, friction: float, spread: float
) -> None:
    """And their shares add up to what all explain."""
    changed = pushes(120, 3, slippery(friction), planted("pressure_spread", "slider_x", ALONG_X, spread))
    evidence, quiet = evidence_of(deployed, changed), evidence_of(deployed, pushes(120, 3))
    terms = motion_effects(deployed, evidence, 0.01, ["elapsed_time", "slider_x"]).terms
    assert {term.best.label for term in terms} == {
        ("contact_friction", "elapsed_time"),
        ("pressure_spread", "slider_x"),
    }
    assert [term.part for term in terms] == [False, False]
    noise = float(np.sum(quiet.z**2) / np.sum(evidence.z**2))
    assert sum(term.share for term in terms) == pytest.approx(1.0 - noise, abs=0.05)


def test_a_small_further_term_of_the_same_mechanism_is_a_part_and_comes_last(deployed: PushModel) -> None:
    changed = pushes(120, 3, slippery(0.3), planted("contact_friction", "slider_x", ALONG_X, 0.05))
    terms = found(deployed, changed)
    assert [(term.best.label, term.part) for term in terms] == [
        (("contact_friction", "elapsed_time"), False),
        (("contact_friction", "slider_x"), True),
    ]


@pytest.mark.parametrize(("gain", "covariate", "left"), [(14.0, "x", True), (16.0, "x", False), (1.0, "y", False)])
def test_what_gains_a_seventh_of_an_effect_along_the_same_covariate_is_left_by_its_fit(
    gain: float, covariate: str, left: bool
) -> None:
    """At most 15 %."""

    def term(mechanism: str, along: str, gain: float) -> Term:
        return Term(Candidate(mechanism, along, ALWAYS, NOISE), 0.001, gain, Naming((along,), (mechanism,), True))

    larger = term("contact_friction", "x", 100.0)
    assert _is_left(term("pressure_spread", covariate, gain), [larger]) == left
    assert _is_left(term("contact_friction", covariate, 14.0), [larger])
    assert not _is_left(larger, [])


@pytest.mark.parametrize(("parts", "one"), [("", False), ("p", False), ("n", True), ("np", True)])
def test_more_than_two_changes_at_once_are_one_that_the_library_lacks(parts: str, one: bool) -> None:
    """Two terms, and further ones that are parts (p) or not (n)."""
    mechanisms = ("tilted_surface", "pressure_spread", "contact_friction", "inertia")[: 2 + len(parts)]
    terms = tuple(
        MotionTerm(
            Candidate(name, "x", ALWAYS, NOISE), 0.001, 9.0 - k, Naming(("x", "y"), (name, "other"), True),
            (("dx", "dy", "dtheta")[k % 3],), 0.1, False, False, k > 1 and parts[k - 2] == "p",
        )
        for k, name in enumerate(mechanisms)
    )  # fmt: skip
    first, *others = _as_one(terms)
    assert (first.mechanism, first.naming.resembles) == ((None, "tilted_surface") if one else ("tilted_surface", None))
    assert first.naming.covariates == ("x", "y") and not first.part
    assert first.outputs == (("dx", "dy", "dtheta") if one else ("dx",))
    assert first.share == pytest.approx(0.1 * len(terms) if one else 0.1)
    assert [term.part for term in others] == [one or was.part for was in terms[1:]]


@pytest.mark.parametrize(("change", "differs"), [(2.4, False), (2.7, True), (-2.7, True)])
def test_an_effect_is_a_change_since_training_if_it_differs_from_that_there(change: float, differs: bool) -> None:
    """By more than 2.58 standard errors of the difference."""
    now, then = (replace(slippery(size), covariance=np.array([[0.5]])) for size in (1.0 + change, 1.0))
    assert _differ(now, then) == differs


def test_an_unknown_effect_on_one_output_shifts_that_one(deployed: PushModel) -> None:
    table = pushes(120, 4)
    sideways = np.outer(3.0 * table.covariates["slider_x"] / 0.1, [0.0, NOISE[1], 0.0])
    (term,) = found(deployed, replace(table, outcomes=table.outcomes + sideways))
    assert (term.mechanism, term.best.covariate, term.outputs) == (None, "slider_x", ("dy",))


def test_a_constant_effect_lies_in_the_inputs_of_a_learnt_base_alone(deployed: PushModel) -> None:
    learnt = train_model(noisy_pushes(150), square_rig(), "gp", name="learnt", options=TrainingOptions(mean="zero"))
    table = pushes(120, 5, planted("contact_friction", "model_inputs", ALWAYS, -0.15))
    (own,) = found(learnt, table)
    (other,) = found(deployed, table)
    assert (own.best.label, own.own) == (("contact_friction", "model_inputs"), True)
    assert (other.best.label, other.own) == (("contact_friction", "model_inputs"), False)


def test_among_extrapolated_pushes_the_speed_is_tried_only_if_most_lie_inside(deployed: PushModel) -> None:
    """Where few do, an error of extrapolation depends on the speed, too."""
    evidence = evidence_of(deployed, pushes(20, 5))
    speed, place = (DriverBasis("linear", (name,), (0.0,), (1.0,)) for name in ("velocity", "slider_x"))
    evidence.table.covariates.setdefault("velocity", evidence.table.inputs[:, 0])
    along = candidate(evidence, "contact_friction", "velocity", speed)
    assert _separable(along, 0.6) and not _separable(along, 0.4)
    assert _separable(candidate(evidence, "contact_friction", "slider_x", place), 0.4)
    assert not _separable(candidate(evidence, "contact_friction", "model_inputs", ALWAYS), 0.6)


# --- moves ------------------------------------------------------------------------------------------------------------


FRICTION, SPREAD = ("contact_friction", "elapsed_time"), ("pressure_spread", "slider_x")
WARMER = ("contact_friction", "topic:/warmth")


def moved(model: PushModel, table: PushTable, *labels: tuple[str, str]) -> list[tuple[str | None, str]]:
    """The labels after the moves from linear terms with these, where the gate let pass all that occur here."""
    evidence = evidence_of(model, table)
    gate = gate_of(model, evidence, ["elapsed_time", "slider_x", "topic:/warmth"])
    search = _Search(gate, FitRows(evidence), dict.fromkeys([FRICTION, SPREAD, WARMER], 0.001))
    chosen = [_linear(evidence_of(model, table).table, model, *label) for label in labels]
    after, _ = search._improved(chosen, search._fit(chosen))
    return [term.label for term in after]


def _linear(table: PushTable, model: PushModel, mechanism: str, covariate: str) -> Candidate:
    basis = replace(standard_basis("linear", covariate, table.covariates[covariate]), offset=True)
    return candidate(evidence_of(model, table), mechanism, covariate, basis)


def warmed(table: PushTable) -> PushTable:
    """The pushes in a room that gets warmer with the time, but not evenly."""
    time = table.covariates["elapsed_time"] / 300.0
    uneven = 0.4 * np.repeat(np.random.default_rng(7).normal(size=len(table.pushes)), 3)
    return replace(table, covariates={**table.covariates, "topic:/warmth": 20.0 + time + uneven})


GROWN, WIDER = slippery(0.1), planted("pressure_spread", "slider_x", ALONG_X, 0.1)


@pytest.mark.parametrize(
    ("acting", "chosen", "left"),
    [
        ([GROWN, WIDER], [FRICTION, SPREAD], {FRICTION, SPREAD}),
        ([GROWN], [SPREAD, FRICTION], {FRICTION}),
        ([GROWN], [FRICTION, SPREAD], {FRICTION}),
        ([GROWN, WIDER], [SPREAD, WARMER], {FRICTION, SPREAD}),
        ([], [FRICTION], {FRICTION}),
    ],
    ids=["needed", "explained by the second", "by the first", "with a worse covariate", "the only one"],
)
def test_a_term_stays_is_dropped_or_exchanged(
    deployed: PushModel, acting: list[Effect], chosen: list[tuple[str, str]], left: set[tuple[str, str]]
) -> None:
    found = moved(deployed, warmed(pushes(120, 3, *acting)), *chosen)
    assert len(found) == len(left) and set(found) == left


@pytest.mark.parametrize(
    ("gain", "further", "size", "enough"),
    [
        (8.0, False, 1, False),
        (12.0, False, 1, True),
        (12.0, False, 6, True),
        (12.0, True, 1, True),
        (12.0, True, 6, False),
        (32.0, True, 6, True),
    ],
)
def test_a_term_must_gain_its_error_and_a_further_one_five_nats_a_coefficient(
    deployed: PushModel, gain: float, further: bool, size: int, enough: bool
) -> None:
    search = _Search(cast("Gate", None), FitRows(evidence_of(deployed, pushes(100, 1))))
    assert search._worthwhile(gaining(gain, size), gaining(0.0, 0), further) == enough


@pytest.mark.parametrize(("gain", "dropped"), [(-12.0, True), (8.0, True), (12.0, False)])
def test_a_term_is_dropped_unless_it_gains_what_a_further_one_must(
    deployed: PushModel, gain: float, dropped: bool
) -> None:
    evidence = evidence_of(deployed, pushes(100, 1))
    chosen = [_linear(evidence.table, deployed, *label) for label in (FRICTION, SPREAD)]
    each = {((c.mechanism, c.covariate, c.basis),): gaining(0.0, 1) for c in chosen}
    after = _Search(cast("Gate", None), FitRows(evidence), known=each)._dropped(chosen, gaining(gain, 2))
    assert (after is not None) == dropped


def gaining(gain: float, size: int) -> Fit:
    """A fit of `size` coefficients that gains so many nats, with a standard error of 10 nats over 100 blocks."""
    uneven = np.where(np.arange(100) % 2, 1.0, -1.0) if gain else np.zeros(100)
    return cast("Fit", SimpleNamespace(scores=uneven + gain / 100.0, coefficients=np.zeros(size)))
