# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Gate and search pass a change since training, and neither chance nor a fixed property of the rig."""

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
    MECHANICS,
    RIG,
    baseline,
    learnt,
    linear,
    pushes,
    searched,
    seen,
    with_effect,
)

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import candidates_of, confounded
from push_predictor.residuals.evidence.inputs_basis import controls_for, inputs_basis
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.selection.gate import Gate, Seen
from push_predictor.residuals.selection.power import minimum_detectable
from push_predictor.residuals.selection.screening import Columns, screen

ALPHA = 0.01
OWN_SIDES = DriverBasis("constant"), 0.003, -0.002  # a centre of friction off the middle
Label = tuple[str | None, str]


@pytest.fixture(autouse=True)
def a_library_of_four(monkeypatch: pytest.MonkeyPatch) -> None:
    """Computing responses takes most of the time."""
    in_library(monkeypatch, *FOUR)


def gate(model: PushModel, table: PushTable) -> Gate:
    return gate_of(model, seen(model, table), DRIVERS, ALPHA, baseline=baseline(model))


def p_values(gate: Gate) -> dict[Label, float]:
    """The smallest p value of each label."""
    found: dict[Label, float] = {}
    screened = gate.screened(gate.evidence.z)
    for candidate, p in zip(gate.candidates, screened.p_value.tolist(), strict=True):
        found[candidate.label] = min(p, found.get(candidate.label, 1.0))
    return found


def test_what_a_candidate_is_projected_off_is_free_of_the_controls_of_its_kind() -> None:
    found = gate(learnt(), pushes(COUNT, 500))
    kinds = {c.kind: c for c in found.candidates if c.nuisance is not None}
    assert "driven" in kinds
    for kind, c in kinds.items():
        controls, nuisance = controls_for(kind, found.inputs), np.asarray(c.nuisance)
        columns = nuisance.reshape(len(controls), -1)  # of each output
        assert np.abs(controls.T @ columns).max(initial=0.0) < 1e-7 * np.abs(controls).max(initial=1.0) * len(controls)


@pytest.mark.parametrize("seed", [500, 501])
def test_nothing_passes_without_an_effect(seed: int) -> None:
    for model in (learnt(), EXACT):
        assert min(p_values(gate(model, pushes(COUNT, seed))).values()) > ALPHA


def test_an_effect_passes_with_its_covariate_and_those_of_others_do_not() -> None:
    plain = pushes(COUNT, 502)
    table = with_effect(plain, "contact_friction", linear(plain, "slider_x"), 0.1)
    passed = {label for label, p in p_values(gate(learnt(), table)).items() if p <= ALPHA}
    assert ("contact_friction", "slider_x") in passed
    assert {covariate for _, covariate in passed} == {"slider_x"}


def test_nothing_passes_on_what_an_effect_leaves() -> None:
    plain = pushes(COUNT, 502)
    changed = gate(learnt(), with_effect(plain, "contact_friction", linear(plain, "slider_x"), 0.1))
    left = changed.screened(seen(learnt(), plain).z)
    assert left.p_value.min() > ALPHA


@pytest.fixture(scope="module")
def one_sided() -> PushModel:
    """A model that folds the sides of a slider whose sides differ."""
    table, options = with_effect(pushes(COUNT, 2), "centre_of_friction", *OWN_SIDES), TrainingOptions(mean="zero")
    return train_model(table, RIG, "gp", name="folds", options=options)


def test_a_property_that_the_rig_had_in_training_too_does_not_pass(one_sided: PushModel) -> None:
    again = gate(one_sided, with_effect(pushes(COUNT, 3), "centre_of_friction", *OWN_SIDES))
    screened = again.screened(again.evidence.z)
    assert screened.p_value.min() > ALPHA
    unchanged = {again.candidates[k].label for k in screened.unchanged}
    assert ("centre_of_friction", "edge") in unchanged
    uncompared = replace(again.baseline, inputs=replace(again.baseline.inputs, learnt=False))
    alone = replace(again, baseline=uncompared).screened(again.evidence.z)
    assert alone.p_value.min() <= ALPHA and not alone.unchanged


def test_what_lies_in_the_nuisance_of_a_candidate_changes_no_score() -> None:
    table = pushes(COUNT, 3)
    since = {**table.covariates, "time_since_contact": np.tile([0.0, 0.2], COUNT)}
    evidence = seen(EXACT, replace(table, covariates=since))
    found = gate_of(EXACT, evidence, ["elapsed_time"], baseline=baseline(EXACT), mechanisms=FOUR[:2])
    c = next(c for c in found.candidates if c.kind == "constant" and c.nuisance is not None)
    assert c.nuisance is not None
    moved = evidence.z + 50.0 * c.nuisance[:, 0].reshape(evidence.z.shape)
    apart = [Seen(found.inputs, z, evidence.block) for z in (evidence.z, moved)]
    first, second = (each.scores(c, each.columns(c)).rows for each in apart)
    np.testing.assert_allclose(first, second, atol=1e-8)


def test_the_opposite_of_that_property_passes(one_sided: PushModel) -> None:
    basis, x, y = OWN_SIDES
    other = with_effect(pushes(COUNT, 3), "centre_of_friction", basis, -x, -y)
    assert p_values(gate(one_sided, other))["centre_of_friction", "edge"] <= ALPHA


def test_an_error_in_a_learnt_models_own_inputs_is_judged_against_training() -> None:
    """Few pushes teach a model its inputs only so well; a new session shows the same error."""
    few = train_model(pushes(25, 4), RIG, "gp", name="few", options=TrainingOptions(mean="zero"))
    found = gate(few, pushes(COUNT, 5))
    own = [k for k, c in enumerate(found.candidates) if c.kind == "constant"]
    assert own and found.screened(found.evidence.z).p_value[own].min() > ALPHA


def test_a_constant_change_of_a_learnt_model_passes() -> None:
    table = with_effect(pushes(COUNT, 503), "contact_friction", DriverBasis("constant"), 0.12)
    assert p_values(gate(learnt(), table))["contact_friction", "model_inputs"] <= ALPHA


def test_p_values_of_one_seed_are_the_same_again() -> None:
    made = gate(EXACT, pushes(COUNT, 504))
    z = made.evidence.z
    np.testing.assert_array_equal(made.screened(z).p_value, made.screened(z).p_value)
    assert not np.array_equal(made.screened(z).p_value, replace(made, seed=1).screened(z).p_value)


# --- the search -------------------------------------------------------------------------------------------------------


WEAK = 0.02


class TestFalseAlarms:
    """On synthetic null data the family-wise p is at most alpha with probability alpha."""

    REPETITIONS = 200
    ALPHA = 0.05

    @pytest.mark.long
    @pytest.mark.parametrize(
        ("tails", "common"), [(np.inf, 0.0), (3.0, 0.8)], ids=["normal", "heavy tails, windows of a push alike"]
    )
    def test_stay_within_binomial_bounds(self, tails: float, common: float) -> None:
        alarms = sum(self._smallest_p(seed, tails, common) <= self.ALPHA for seed in range(self.REPETITIONS))
        error = np.sqrt(self.REPETITIONS * self.ALPHA * (1.0 - self.ALPHA))
        assert alarms <= self.REPETITIONS * self.ALPHA + 3.0 * error
        assert alarms >= self.REPETITIONS * self.ALPHA - 3.0 * error

    def _smallest_p(self, seed: int, tails: float, common: float) -> float:
        rng = np.random.default_rng(seed)
        n, pushed = 120, np.repeat(np.arange(40), 3)
        angle = rng.uniform(-1.0, 1.0, 40)[pushed]
        basis = np.cos(angle[:, None] * np.arange(8))  # a fifth of the pushes: as rich as it gets
        draw = rng.standard_normal if np.isinf(tails) else lambda size: rng.standard_t(tails, size)
        z = np.sqrt(common) * draw((40, 3))[pushed] + np.sqrt(1.0 - common) * draw((n, 3))
        walk = np.cumsum(rng.normal(size=40))[pushed]
        drivers = [pushed / 40.0, pushed / 40.0 + 0.01 * walk, walk, walk**2, rng.normal(size=40)[pushed]]
        responses = [np.eye(3)[:, :1] * angle[:, None, None], np.eye(3) * (1.0 + angle[:, None, None])]
        columns = [response * driver[:, None, None] for response in responses for driver in drivers]
        residualizer = Residualizer(basis)
        blocks, each = residualizer.blocks(z, pushed), [Columns(residualizer(c)) for c in columns]
        return float(screen([c.scores(blocks).turned(c.unit) for c in each], seed).p_value.min())

    def test_the_gate_alone_decides_at_its_level(self) -> None:
        """A weak effect, at levels above and below its p value."""
        plain = pushes(COUNT, 106)
        weak = with_effect(plain, "contact_friction", linear(plain, "slider_x"), WEAK)
        gate = gate_of(EXACT, seen(EXACT, weak), DRIVERS, baseline=baseline(EXACT))
        p = float(gate.screened(gate.evidence.z).p_value.min())
        assert 0.001 < p < 0.2
        above, below = (search_with(EXACT, replace(gate, alpha=share * p)).terms for share in (1.1, 0.9))
        assert [term.best.label for term in above] == [("contact_friction", "slider_x")]
        assert above[0].p_value == p
        assert not below

    def test_covariate_confounded_with_the_inputs_is_not_tried(self) -> None:
        """In pushes ordered by angle, time would be blamed for errors of the base in the angle."""
        table = pushes(COUNT, 3)
        ordered = replace(table, covariates={**table.covariates, "elapsed_time": 100.0 * table.inputs[:, 2]})
        evidence, inputs = seen(learnt(), ordered), inputs_basis(learnt(), ordered)
        assert confounded(evidence, DRIVERS, inputs) == ["elapsed_time"]
        assert "elapsed_time" not in {c.covariate for c in candidates_of(evidence, DRIVERS, inputs)}

    def test_late_touch_detection_is_no_effect(self) -> None:
        """Only the window that begins with the touch is shorter, by the distance that the pusher travels."""
        table = pushes(COUNT, 3)
        since = np.tile([0.0, 0.2], COUNT)
        late = np.where(since == 0.0, 0.97, 1.0)
        short = MECHANICS.displacement(table.inputs, table.duration * late)
        moved = table.outcomes + short - MECHANICS.displacement(table.inputs, table.duration)
        table = replace(table, outcomes=moved, covariates={**table.covariates, "time_since_contact": since})
        assert not searched(EXACT, table).terms

    def test_cross_validated_residuals_of_a_learned_base_are_calibrated(self) -> None:
        deviation = baseline(learnt()).evidence.z.std(axis=0)
        assert np.all((deviation > 0.85) & (deviation < 1.15))

    @pytest.mark.slow
    def test_effects_above_the_detectable_size_are_found_and_far_smaller_ones_are_not(self) -> None:
        table = pushes(COUNT, 103)
        gate = gate_of(learnt(), seen(learnt(), table), DRIVERS, baseline=baseline(learnt()))
        sizes = minimum_detectable(search_with(learnt(), gate), gate.evidence, gate.inputs, 0.01, gate.baseline)
        size = sizes["contact_friction"]
        assert size["unit"] == "1"
        small, large = (
            with_effect(table, "contact_friction", DriverBasis("constant"), share * size["value"])
            for share in (0.2, 1.5)
        )
        assert not searched(learnt(), small).terms
        assert searched(learnt(), large).terms
