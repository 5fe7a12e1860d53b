# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The variance channel: covariates that the noise of the outcomes depends on, after effects on the mean.

The test uses squared residuals, bounded so that a few outlying pushes decide nothing; the size is of their logarithm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import OUTPUTS, concatenate
from push_predictor.residuals.channels.contrast import (
    MAD_TO_SD,
    ChannelFinding,
    Quantity,
    along,
    effects_of,
    searched,
    stacked,
)
from push_predictor.residuals.evidence.drivers import CONSTANT, screening_bases
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.residualizer import sums_by
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.power import QUANTILE
from push_predictor.types import Array, IntArray

TINY = 1e-12
MOST = 9.0  # of a square, three standard deviations: guards against a few windows far off
TRIED = (np.ones(3), *np.eye(3))  # all outputs, then each
NOTABLE = 1.2  # least factor: guards against a base that saw few pushes and misjudges its own noise a little


def variance_effects(
    model: PushModel,
    evidence: Evidence,
    z: Array,
    alpha: float,
    seed: int = 0,
    *,
    names: Sequence[str] | None = None,
    training: Evidence | None = None,
) -> ChannelFinding:
    """Test the variance of residuals z (n, 3), without mean effects, against every covariate and against training."""
    stack = stacked(evidence.table, None if training is None else training.table)
    bases, parts = screening_bases(evidence.table, names), [(z, evidence.block)]
    if training is not None and len(stack.tables) > 1:
        bases.append((CONSTANT, DriverBasis("constant")))
        parts.append((training.z, training.block))
        z = np.vstack([training.z, z])
        # The errors of a base differ from those in training as functions of its inputs, too.
        own = np.zeros((len(z), (inputs := inputs_basis(model, evidence.table).columns).shape[1]))
        own[stack.new] = inputs
        stack = replace(stack, level=own)
    tried = [along(stack, None, *pair, on) for pair in bases for on in TRIED]
    controls = inputs_basis(model, concatenate(stack.tables)).columns
    every = np.ones(len(z), dtype=np.bool_)
    noise = Quantity.of(_bounded_squares(z), controls, stack, tried, every)
    chosen, tested, threshold = searched(noise, alpha, seed)
    logarithms = replace(noise, z=np.log(z**2 + TINY), controls=np.ones((len(z), 1)))
    effects = tuple(
        replace(effect, outputs=tuple(name for name, on in zip(OUTPUTS, each.contrast.on, strict=True) if on))
        for each, effect in zip(
            chosen,
            effects_of(chosen, logarithms, evidence.table, "factor on the noise", lambda c: np.exp(0.5 * c), seed),
            strict=True,
        )
        if abs(np.log(effect.values[0])) > np.log(NOTABLE)
    )
    return ChannelFinding(effects, tested, _detectable(threshold, parts))


def _detectable(threshold: float, parts: Sequence[tuple[Array, IntArray]]) -> float:
    """The ratio of standard deviations whose squares exceed the threshold with 80 % probability; NaN without training.

    parts: residuals (n, 3) and blocks (n,) of new and of training windows.
    """
    square = 0.0
    for residual, block in parts:
        size = _bounded_squares(residual).mean(axis=1)
        of_block = sums_by(block, (size / size.mean() - 1.0)[:, None])[:, 0]
        square += float(np.sum(of_block**2)) / len(size) ** 2
    found = max(NOTABLE, float(np.sqrt(1.0 + (threshold + QUANTILE) * np.sqrt(square))))
    return found if len(parts) > 1 else float("nan")


def _bounded_squares(residual: Array) -> Array:
    """Squares (n, 3) in units of each output's robust variance, at most MOST."""
    unit = MAD_TO_SD * np.median(np.abs(residual), axis=0)
    return np.asarray(np.minimum((residual / np.maximum(unit, TINY)) ** 2, MOST))
