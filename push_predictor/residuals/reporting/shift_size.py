"""How far an effect shifts the outcome: root mean square over the windows of a table, with 95 % intervals."""

from __future__ import annotations

import numpy as np

from push_predictor.models.effects.effect import Effect, design_of
from push_predictor.models.mechanisms import Push
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.residuals.evidence.standardised import physics_of
from push_predictor.residuals.outcome import Sized, Trace
from push_predictor.types import Array

DRAWS = 500
OUTPUT_UNITS = dict(zip(OUTPUTS, ("m", "m", "rad"), strict=True))


def shift_sizes(trace: Trace, effect: Effect, table: PushTable) -> tuple[Sized, ...]:
    """Root mean square shift of each output (m, m, rad); intervals from draws of the effect's coefficients."""
    push = Push(table.inputs, table.duration, table.covariates)
    square = _mean_square(trace, effect, push)
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(effect.coefficients, effect.covariance, DRAWS, method="svd")
    spread = np.sqrt(np.maximum(np.einsum("da,kab,db->dk", draws, square, draws), 0.0))
    value = np.sqrt(np.maximum(np.einsum("a,kab,b->k", effect.coefficients, square, effect.coefficients), 0.0))
    low, high = np.quantile(spread, [0.025, 0.975], axis=0)
    ends = zip(OUTPUTS, value.tolist(), low.tolist(), high.tolist(), strict=True)
    return tuple(Sized(f"root mean square shift of {o}", v, a, b, OUTPUT_UNITS[o]) for o, v, a, b in ends)


def _mean_square(trace: Trace, effect: Effect, push: Push) -> Array:
    """Mean over the windows of the squared design, per output: (3, q, q)."""
    design = design_of(effect.mechanism, effect.basis, physics_of(trace.model), push, effect.outcome_scale)
    return np.asarray(np.einsum("nka,nkb->kab", design, design) / max(len(design), 1))
