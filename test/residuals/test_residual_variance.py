# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Effects on the variance: found as such, and not as effects on the mean."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from search_bench import in_library
from square_session import COUNT, FOUR, MECHANICS, NOISE, RIG, baseline, learnt, pushes, searched, seen

from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.channels.contrast import ChannelEffect
from push_predictor.residuals.channels.variance import variance_effects
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.types import Array


@pytest.fixture(autouse=True)
def a_library_of_four(monkeypatch: pytest.MonkeyPatch) -> None:
    """Computing responses takes most of the time."""
    in_library(monkeypatch, *FOUR)


def noise_of(evidence: Evidence, z: Array, alpha: float = 0.01) -> tuple[ChannelEffect, ...]:
    """What differs from training, whatever the covariates."""
    return variance_effects(learnt(), evidence, z, alpha, names=(), training=baseline(learnt()).evidence).effects


def louder_to_the_right(n: int, seed: int) -> PushTable:
    """Pushes whose noise grows with the place along x."""
    table = pushes(n, seed)
    clean = MECHANICS.displacement(table.inputs, table.duration)
    factor = np.exp(0.5 * table.covariates["slider_x"] / 0.03)
    return replace(table, outcomes=clean + factor[:, None] * (table.outcomes - clean))


class TestVariance:
    @pytest.mark.slow
    def test_variance_that_grows_with_a_covariate_is_not_a_mean_effect(self) -> None:
        louder = louder_to_the_right(COUNT, 400)
        found = searched(learnt(), louder)
        evidence = seen(learnt(), louder)
        noise = variance_effects(learnt(), evidence, found.unexplained, 0.01, training=baseline(learnt()).evidence)
        assert not found.terms
        assert noise.effects[0].covariate == "slider_x"
        assert noise.effects[0].parameters[0].value > 2.0

    @pytest.mark.slow
    def test_variance_that_grew_with_the_covariate_in_training_too_is_not_reported(self) -> None:
        model = train_model(
            louder_to_the_right(COUNT, 403), RIG, "gp", name="uneven", options=TrainingOptions(mean="zero")
        )
        evidence = seen(model, louder_to_the_right(COUNT, 404))
        assert not variance_effects(model, evidence, evidence.z, 0.01, training=baseline(model).evidence).effects
        alone = variance_effects(model, evidence, evidence.z, 0.01).effects
        assert [effect.covariate for effect in alone] == ["slider_x"]

    def test_variance_as_in_training_is_not_reported(self) -> None:
        table = pushes(COUNT, 401)
        evidence = seen(learnt(), table)
        assert not variance_effects(learnt(), evidence, evidence.z, 0.01, training=baseline(learnt()).evidence).effects

    @pytest.mark.parametrize(("noise", "low", "high"), [(2.0, 1.6, 2.5), (0.5, 0.5, 0.8)])
    def test_larger_or_smaller_variance_than_in_training_is_reported_as_constant(
        self, noise: float, low: float, high: float
    ) -> None:
        """Of all outputs; the errors of the model itself do not fall with the noise."""
        table = pushes(COUNT, 402, noise=noise * NOISE)
        evidence = seen(learnt(), table)
        found = variance_effects(learnt(), evidence, evidence.z, 0.01, training=baseline(learnt()).evidence).effects
        assert (found[0].covariate, found[0].outputs) == ("model_inputs", ("dx", "dy", "dtheta"))
        assert low < found[0].parameters[0].value < high

    def test_slightly_larger_variance_than_in_training_is_not_reported(self) -> None:
        evidence = seen(learnt(), pushes(COUNT, 401))
        noise = [
            variance_effects(
                learnt(), evidence, scale * evidence.z, 0.9, names=(), training=baseline(learnt()).evidence
            ).effects
            for scale in (1.05, 1.5)
        ]
        assert not noise[0] and noise[1][0].covariate == "model_inputs"

    def test_a_window_far_off_does_not_hide_a_larger_variance(self) -> None:
        evidence = seen(learnt(), pushes(COUNT, 402, noise=2.0 * NOISE))
        z = evidence.z.copy()
        z[7] *= 300.0
        noise = noise_of(evidence, z)
        assert [effect.covariate for effect in noise] == ["model_inputs"]

    def test_variance_of_one_output_is_reported_of_that_one(self) -> None:
        evidence = seen(learnt(), pushes(COUNT, 401))
        z = evidence.z * [1.0, 2.0, 1.0]
        (effect,) = variance_effects(
            learnt(), evidence, z, 0.01, names=(), training=baseline(learnt()).evidence
        ).effects
        assert effect.outputs == ("dy",)
