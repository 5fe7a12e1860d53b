# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Sliders: outline, mass, moment of inertia and support points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.errors import RigError
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import MASSES, shape_outline
from push_predictor.types import Array

SUPPORT_POINTS = 36  # approximate number; the grid over the outline decides
BUILD_TILT = 0.10  # standard deviation of the log load from manufacture: real sliders are not exactly symmetric


@dataclass(frozen=True, eq=False)
class Slider:
    """A slider of uniform density: name, outline, mass in kg."""

    name: str
    outline: Outline
    mass: float

    @property
    def inertia(self) -> float:
        """Moment of inertia about the centroid, kg m^2."""
        return self.mass * self.outline.polar_moment


def slider_named(name: str) -> Slider:
    """A slider of the MIT set. Raises RigError for a name that is not in MASSES."""
    if name not in MASSES:
        raise RigError(f"shape: {name!r} is not accepted, give one of {', '.join(MASSES)}")
    return Slider(name, shape_outline(name), MASSES[name])


def support_points(outline: Outline) -> Array:
    """Points (k, 2) in m, body frame: a square grid over the outline, symmetric where the outline is."""
    step = np.sqrt(outline.area / SUPPORT_POINTS)
    reach = np.max(np.abs(outline.vertices))
    ticks = (np.arange(np.ceil(reach / step)) + 0.5) * step
    axis = np.concatenate([-ticks[::-1], ticks])
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    return np.asarray(grid[outline.project(grid).distance < 0.0])


def built_shares(points: Array, seed: int) -> Array:
    """Load shares (k,) of a manufactured slider, with sum one: nearly uniform, slightly asymmetric."""
    load = np.exp(BUILD_TILT * pressure_patterns(points, 1, np.random.default_rng([seed, 2]))[0])
    return np.asarray(load / np.sum(load))


def pressure_patterns(points: Array, n: int, rng: np.random.Generator) -> Array:
    """Random deviations (n, k) of the log load on points (k, 2), with unit variance.

    Half of the variance is a tilt of the pressure, a quarter is curvature (rim against middle, saddle) and a quarter
    is independent between points.
    """
    scaled = points / np.sqrt(np.mean(points**2))
    curvature = np.stack([np.sum(scaled**2, axis=1) - 2.0, scaled[:, 0] * scaled[:, 1]])
    tilt = rng.standard_normal((n, 2)) @ scaled.T / np.sqrt(2.0)
    curved = rng.standard_normal((n, 2)) @ curvature / np.sqrt(2.0 * np.mean(curvature**2))
    single = rng.standard_normal((n, len(points)))
    return np.asarray(np.sqrt(0.5) * tilt + 0.5 * curved + 0.5 * single)
