# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The search finds nothing without an effect: its false-alarm rate, and what resembles an effect but is none."""

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
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.residuals.candidates.candidate import candidates_of, confounded
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.selection.power import minimum_detectable
from push_predictor.residuals.selection.screening import Controlled, screen

WEAK = 0.02


@pytest.fixture(autouse=True)
def a_library_of_four(monkeypatch: pytest.MonkeyPatch) -> None:
    """Computing responses takes most of the time."""
    in_library(monkeypatch, *FOUR)


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
        seen = Controlled.of(z, basis, pushed)
        return float(screen([seen.unit_scores(c) for c in columns], seed).p_value.min())


class TestNoEffect:
    @pytest.mark.slow
    def test_finds_nothing_with_a_learned_base_of_few_pushes(self) -> None:
        verdicts = [searched(learnt(), pushes(COUNT, 100 + seed)) for seed in range(3)]
        assert [len(found.terms) for found in verdicts] == [0, 0, 0]

    @pytest.mark.slow
    def test_effect_that_training_shows_too_is_not_selected(self) -> None:
        """A slider whose sides differ, learned by a model that folds them, has not changed since training."""
        shift = DriverBasis("constant"), 0.003, -0.002
        base = train_model(
            with_effect(pushes(COUNT, 2), "centre_of_friction", *shift),
            RIG,
            "gp",
            name="folds",
            options=TrainingOptions(mean="zero"),
        )
        same = searched(base, with_effect(pushes(COUNT, 3), "centre_of_friction", *shift))
        assert not same.terms
        assert any(same.candidates[k].label == ("centre_of_friction", "edge") for k in same.first.unchanged)
        other = searched(
            base, with_effect(pushes(COUNT, 3), "centre_of_friction", DriverBasis("constant"), -0.003, 0.002)
        )
        assert other.terms[0].best.label == ("centre_of_friction", "edge")

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
        deviation = baseline(learnt()).deviation
        assert np.all((deviation > 0.85) & (deviation < 1.15))

    @pytest.mark.slow
    def test_effects_above_the_detectable_size_are_found_and_far_smaller_ones_are_not(self) -> None:
        table = pushes(COUNT, 103)
        gate = gate_of(learnt(), seen(learnt(), table), DRIVERS, baseline=baseline(learnt()))
        sizes = minimum_detectable(search_with(learnt(), gate), gate.evidence, gate.inputs, 0.01, gate.baseline)
        size = sizes["contact_friction"]["driven"]
        assert size["unit"] == "1"
        small, large = (
            with_effect(table, "contact_friction", linear(table, size["covariate"]), share * size["value"])
            for share in (0.2, 1.5)
        )
        assert not searched(learnt(), small).terms
        assert searched(learnt(), large).terms
