# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Hartigan's dip test: does a sample have one mode or several (Hartigan and Hartigan 1985).

The dip of a sample is the largest difference between its distribution function and the nearest unimodal one. It lies
between 1 / (2 n) and 1 / 4. The package `diptest` computes it; p values compare it with samples of the uniform
distribution, the unimodal distribution that is hardest to distinguish from a bimodal one.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from diptest import dipstat

from push_predictor.types import Array

ROUNDING = 1e-12  # dips closer than this are equal


def dip(samples: Array) -> Array:
    """Dips (b,) of samples (b, n) in any order, n >= 2."""
    ordered = np.sort(samples, axis=1)
    return np.array([dipstat(sample, sort_x=False, allow_zero=False) for sample in ordered], dtype=np.float64)


def p_values(dips: Array, n: int, draws: int) -> Array:
    """P values (k,) of dips (k,) of samples of size n, by Monte Carlo with `draws` samples of the uniform distribution.

    They are at least 1 / (draws + 1).
    """
    null = uniform_dips(n, draws)
    return np.asarray((1.0 + draws - np.searchsorted(null, dips - ROUNDING)) / (draws + 1.0))


@cache
def uniform_dips(n: int, draws: int, seed: int = 0) -> Array:
    """Sorted dips (draws,) of samples of size n of the uniform distribution."""
    return np.sort(dip(np.random.default_rng([seed, n]).random((draws, n))))


def holm(p: Array) -> Array:
    """Family-wise p values (k,) of p values (k,) by Holm's (1979) step-down correction."""
    order = np.argsort(p)
    adjusted = np.maximum.accumulate((len(p) - np.arange(len(p))) * p[order])
    result = np.empty(len(p))
    result[order] = np.minimum(adjusted, 1.0)
    return result


def power(n: int, separation: float, critical: float, draws: int = 1000, seed: int = 0) -> float:
    """Share of samples of size n from two equal normal modes whose dip reaches `critical`.

    separation: distance of the modes in units of their standard deviation.
    """
    return float(np.mean(_two_mode_dips(n, separation, draws, seed) >= critical))


@cache
def _two_mode_dips(n: int, separation: float, draws: int, seed: int) -> Array:
    rng = np.random.default_rng([seed, n, round(1e3 * separation)])
    return dip(rng.standard_normal((draws, n)) + separation * rng.integers(0, 2, (draws, n)))
