# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the motion channel says of each term: which outputs it shifts, how much it explains, and what is no effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_traces import NOISE, planted, pushes, slippery
from search_bench import in_library
from synthetic import noisy_pushes, square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import candidate
from push_predictor.residuals.channels.motion import MotionTerm, _separable, motion_effects
from push_predictor.residuals.evidence.standardised import evidence_of

ALWAYS = DriverBasis("constant")
ALONG_X = DriverBasis("linear", ("slider_x",), (0.0,), (0.1,))


@pytest.fixture(scope="module")
def deployed() -> PushModel:
    return train_model(pushes(100, 1), square_rig(), "analytical", name="deployed")


@pytest.fixture(autouse=True)
def a_library_of_two(monkeypatch: pytest.MonkeyPatch) -> None:
    """Computing responses takes most of the time."""
    in_library(monkeypatch, "contact_friction", "pressure_spread")


def found(model: PushModel, table: PushTable) -> tuple[MotionTerm, ...]:
    return motion_effects(model, evidence_of(model, table), 0.01, ["elapsed_time", "slider_x"]).terms


@pytest.mark.parametrize(("friction", "spread"), [(0.1, 0.1), (0.3, 0.06)], ids=["alike", "one far larger"])
def test_two_effects_of_other_mechanisms_and_covariates_are_two(
    deployed: PushModel, friction: float, spread: float
) -> None:
    changed = pushes(120, 3, slippery(friction), planted("pressure_spread", "slider_x", ALONG_X, spread))
    terms = found(deployed, changed)
    assert {term.best.label for term in terms} == {
        ("contact_friction", "elapsed_time"),
        ("pressure_spread", "slider_x"),
    }
    assert [term.part for term in terms] == [False, False]


def test_a_small_further_term_of_the_same_mechanism_is_a_part_and_comes_last(deployed: PushModel) -> None:
    changed = pushes(120, 3, slippery(0.3), planted("contact_friction", "slider_x", ALONG_X, 0.05))
    terms = found(deployed, changed)
    assert [(term.best.label, term.part) for term in terms] == [
        (("contact_friction", "elapsed_time"), False),
        (("contact_friction", "slider_x"), True),
    ]


def test_shares_of_the_terms_add_up_to_what_all_explain(deployed: PushModel) -> None:
    changed = pushes(120, 3, slippery(0.1), planted("pressure_spread", "slider_x", ALONG_X, 0.1))
    finding = motion_effects(deployed, evidence_of(deployed, changed), 0.01, ["elapsed_time", "slider_x"])
    quiet = evidence_of(deployed, pushes(120, 3))
    noise = float(np.sum(quiet.z**2) / np.sum(evidence_of(deployed, changed).z ** 2))
    assert sum(term.share for term in finding.terms) == pytest.approx(1.0 - noise, abs=0.05)


def test_an_unknown_effect_on_one_output_shifts_that_one(deployed: PushModel) -> None:
    table = pushes(120, 4)
    sideways = np.outer(3.0 * table.covariates["slider_x"] / 0.1, [0.0, NOISE[1], 0.0])
    (term,) = found(deployed, replace(table, outcomes=table.outcomes + sideways))
    assert (term.mechanism, term.best.covariate, term.outputs) == (None, "slider_x", ("dy",))


def test_p_value_counts_that_the_variance_is_tested_too(deployed: PushModel) -> None:
    (term,) = found(deployed, pushes(120, 3, slippery(0.1)))
    assert term.p_value == pytest.approx(term.term.p_value / 0.75)


def test_a_constant_effect_lies_in_the_inputs_of_a_learnt_base_alone(deployed: PushModel) -> None:
    learnt = train_model(noisy_pushes(300), square_rig(), "gp", name="learnt", options=TrainingOptions(mean="zero"))
    table = pushes(120, 5, planted("contact_friction", "model_inputs", ALWAYS, -0.15))
    (own,) = found(learnt, table)
    (other,) = found(deployed, table)
    assert (own.best.label, own.own) == (("contact_friction", "model_inputs"), True)
    assert (other.best.label, other.own) == (("contact_friction", "model_inputs"), False)


def test_a_model_without_a_change_has_no_terms(deployed: PushModel) -> None:
    assert found(deployed, pushes(120, 6)) == ()


def test_among_extrapolated_pushes_the_speed_is_tried_only_if_most_lie_inside(deployed: PushModel) -> None:
    """Where few do, an error of extrapolation depends on the speed, too."""
    evidence = evidence_of(deployed, pushes(20, 5))
    speed, place = (DriverBasis("linear", (name,), (0.0,), (1.0,)) for name in ("velocity", "slider_x"))
    evidence.table.covariates.setdefault("velocity", evidence.table.inputs[:, 0])
    along = candidate(evidence, "contact_friction", "velocity", speed)
    assert _separable(along, 0.6) and not _separable(along, 0.4)
    assert _separable(candidate(evidence, "contact_friction", "slider_x", place), 0.4)
    assert not _separable(candidate(evidence, "contact_friction", "model_inputs", ALWAYS), 0.6)
