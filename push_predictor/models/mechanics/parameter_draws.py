# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Draws of the forward model's parameters: from their priors, or from a normal distribution about fitted values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from push_predictor.models.mechanics.forward import COLUMN, TEXTBOOK, PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS
from push_predictor.types import Array

DRAWS = 64
# Their sign changes in a mirror along the body's x axis, where the others keep theirs.
MIRRORED = (
    "friction_difference",
    "centre_y",
    "body_anisotropy_diagonal",
    "tracker_rotation",
    "push_rotation",
    "outline_y",
    "tip_offset_across",
)
# Through the speed: they matter beyond quasi-static pushing, and without them only the distance travelled counts. The
# height of a push shifts the pressure, as centre_x and centre_y do; the rim exponent spreads it.
NOT_DRAWN = ("inertia", "friction_by_speed", "clock_delay", "pushing_height", "pressure_spread")
# Of the spreads of PARAMETERS, which are weak priors for fits. Set once on 21 rigs, simulated by three simulators and
# measured in two laboratories: before the first push, 95 % intervals then cover 0.97 on average, and 0.89 on the worst.
PRIOR_SHARE = 0.7


def drawn_parameters(known_support: bool) -> tuple[str, ...]:
    """Names of the parameters that are drawn: those that need no covariate, and no patch if the support is known."""
    left_out = (*NOT_DRAWN, "rim_exponent") if known_support else NOT_DRAWN
    return tuple(p.name for p in PARAMETERS if not p.needs and p.name not in left_out)


def prior_spreads(names: Sequence[str]) -> Array:
    """Standard deviations (p,) from rig to rig of the parameters before the first push."""
    return np.array([PRIOR_SHARE * BY_NAME[name].spread for name in names])


def prior_draws(names: Sequence[str], means: Array, seed: int, count: int = DRAWS) -> Array:
    """Draws (count, p) from the priors, normal about `means` (p,) and cut off at the plausible ranges.

    A scrambled Sobol' sequence of half of them; the other half are their mirror images, so that a symmetric outline
    gets symmetric predictions. Deterministic for a seed.
    """
    table = [BY_NAME[name] for name in names]
    spread = prior_spreads(names)
    low = scipy.special.ndtr((np.array([p.low for p in table]) - means) / spread)
    high = scipy.special.ndtr((np.array([p.high for p in table]) - means) / spread)
    half = means + spread * scipy.special.ndtri(low + (high - low) * _sobol(len(names), count // 2, seed))
    sign = np.array([-1.0 if name in MIRRORED else 1.0 for name in names])
    return np.concatenate([half, sign * half])


def normal_draws(names: Sequence[str], means: Array, covariance: Array, seed: int, count: int = DRAWS) -> Array:
    """Draws (count, p) in pairs on opposite sides of `means` (p,), moved into the plausible ranges."""
    table = [BY_NAME[name] for name in names]
    half = scipy.special.ndtri(_sobol(len(names), count // 2, seed)) @ np.linalg.cholesky(covariance).T
    draws = means + np.concatenate([half, -half])
    return np.asarray(np.clip(draws, [p.low for p in table], [p.high for p in table]))


def displacements(
    mechanics: PushMechanics,
    names: Sequence[str],
    draws: Array,
    inputs: Array,
    duration: Array,
    covariates: Mapping[str, Array],
) -> Array:
    """Displacements (n, k, 3: m, m, rad) of n pushes under k draws (k, p) of the parameters.

    inputs (n, 3), duration (n,) s, covariates as in PushMechanics.displacement.
    """
    n, k = len(inputs), len(draws)
    values = np.tile(TEXTBOOK, (n, k, 1))
    values[:, :, [COLUMN[name] for name in names]] = draws
    repeated = {name: np.repeat(column, k) for name, column in covariates.items()}
    moved = mechanics.displaced(
        values.reshape(n * k, -1), np.repeat(inputs, k, axis=0), np.repeat(duration, k), repeated
    )
    return moved.reshape(n, k, 3)


def _sobol(dimensions: int, count: int, seed: int) -> Array:
    from scipy.stats import qmc  # its import would take every node 0.4 s at the start

    uniform = qmc.Sobol(dimensions, scramble=True, seed=seed).random(count)
    return np.asarray(np.clip(uniform, 1e-9, 1.0 - 1e-9))
