# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The metrics NMSE, NLPD and coverage, the same offline and online (docs/reference/json.md).

NLPD is the negative log predictive density in SI units (m, m, rad); totals are sums over the three outputs.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from push_predictor.types import Array

COVERAGE_LEVELS = (0.5, 0.9, 0.95)
LEGEND = (
    "NMSE: 0 is perfect, 1 is no better than {reference}. The total is their sum, so 3 for {reference}.",
    "NLPD: nats per window in SI units, lower is better.",
    "exact NLPD: of the model's own predictive density; NLPD is of the Gaussian with the same moments.",
    "in 90 %: share of outcomes inside the predicted 90 % interval.",
)


def nmse_reference(n_train: int) -> str:
    """In words, what has an NMSE of 1 for every output: without training windows there is no mean of their outcomes."""
    return "the training mean" if n_train else "predicting no motion"


def nmse(mean: Array, outcomes: Array, training_mean: Array) -> Array:
    """Squared error (k,) of predictions (n, k), divided by that of the training mean (k,)."""
    error = np.sum((outcomes - mean) ** 2, axis=0)
    spread = np.sum((outcomes - training_mean) ** 2, axis=0)
    return np.asarray(np.divide(error, spread, out=np.full(error.shape, np.nan), where=spread > 0.0))


def gaussian_nlpd(mean: Array, variance: Array, outcomes: Array) -> Array:
    """Negative log density (n, k) of outcomes under independent Gaussians, mean and variance (n, k)."""
    return np.asarray(0.5 * (np.log(2.0 * np.pi * variance) + (outcomes - mean) ** 2 / variance))


def joint_nlpd(mean: Array, covariance: Array, outcomes: Array) -> Array:
    """Negative log density (n,) of outcomes (n, k) under Gaussians with full covariance (n, k, k)."""
    z = standardised(mean, covariance, outcomes)
    log_determinant = np.linalg.slogdet(covariance)[1]
    return np.asarray(0.5 * (np.sum(z**2, axis=1) + log_determinant + z.shape[1] * np.log(2.0 * np.pi)))


def standardised(mean: Array, covariance: Array, outcomes: Array) -> Array:
    """Residuals (n, k) in units of the prediction: L^-1 (outcome - mean), L L' = covariance (n, k, k)."""
    lower = np.linalg.cholesky(covariance)
    return np.asarray(np.linalg.solve(lower, (outcomes - mean)[..., None])[..., 0])


def whitener_of(covariance: Array) -> Array:
    """L^-1 (n, 3, 3) of covariances (n, 3, 3) = L L'."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))


def coverage(mean: Array, variance: Array, outcomes: Array, half_width: Array) -> Array:
    """Share (k,) of outcomes inside central intervals of half_width (k,), in predicted standard deviations."""
    return np.asarray(np.mean(np.abs(outcomes - mean) <= half_width * np.sqrt(variance), axis=0))


def metrics_lines(metrics: Mapping[str, Any]) -> list[str]:
    """Lines of text: what was scored, a line per output and the total, intervals of the totals, how to read them."""
    levels = "".join(f"{f'in {100.0 * float(level):.0f} %':>9s}" for level in metrics["coverage"])
    lines = [
        f"{metrics['model']}: {metrics['n_test']} windows of {metrics['n_pushes']} pushes, "
        f"trained on {metrics['n_train']} windows",
        f"{'':8s}{'NMSE':>9s}{'NLPD':>10s}{'exact NLPD':>12s}{levels}",
        *(_output_line(metrics, name) for name in ("dx", "dy", "dtheta", "total")),
    ]
    interval = metrics["interval"]
    if interval["nmse"] is not None:
        lines.append(f"95 % intervals of the totals: NMSE {_range(interval['nmse'])}, NLPD {_range(interval['nlpd'])}")
    reference = nmse_reference(metrics["n_train"])
    return [*lines, *(line.format(reference=reference) for line in LEGEND)]


def _output_line(metrics: Mapping[str, Any], name: str) -> str:
    shares = [level and level.get(name) for level in metrics["coverage"].values()]
    exact = (metrics["exact_nlpd"] or {}).get(name)
    cells = [cell(metrics["nmse"][name], 9), cell(metrics["nlpd"][name], 10), cell(exact, 12)]
    return f"{name:8s}" + "".join(cells + [cell(share, 9) for share in shares])


def cell(value: float | None, width: int) -> str:
    """A score right-aligned in a column of a terminal's table."""
    return f"{'-':>{width}s}" if value is None else f"{value:{width}.3f}"


def _range(interval: Mapping[str, float]) -> str:
    return f"{interval['low']:.3f} to {interval['high']:.3f}"
