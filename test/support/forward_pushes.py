# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes of the forward model: sliders with their tables, random pushes, and how far a push moves a slider."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from supports import FOUR_POINTS, THREE_POINTS

from push_predictor.geometry.shapes import shape_outline, square
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.surface import uniform_ellipsoid
from push_predictor.types import Array

RADIUS = 0.00475
IN_METRES = np.array([1.0, 1.0, 0.034])
SQUARE = square(0.09)


@cache
def mechanics(shape: str = "rect1", kind: str = "patch") -> PushMechanics:
    """Kept for all tests: a table takes a tenth of a second."""
    outline = shape_outline(shape)
    kinds = {"patch": None, "three": THREE_POINTS, "four": FOUR_POINTS, "ellipsoid": uniform_ellipsoid(outline)}
    return PushMechanics(outline, RADIUS, kinds[kind])


def pushes(n: int, seed: int = 0, travel: float = 0.004, speed: float = 0.02) -> tuple[Array, Array]:
    draw = np.random.default_rng(seed)
    inputs = np.column_stack([np.full(n, speed), draw.random(n), draw.uniform(-1.3, 1.3, n)])
    return inputs, np.full(n, travel / speed)


def moved(
    model: PushMechanics,
    values: Mapping[str, float | Array],
    inputs: Array,
    duration: Array,
    heading: Array | float = 0.0,
) -> Array:
    """Displacements of pushes along a heading in the world."""
    return model.displacement(values, inputs, duration, {"push_heading": np.broadcast_to(heading, len(inputs))})


def one(contact: float = 0.125, angle: float = 0.0, travel: float = 0.004) -> tuple[Array, Array]:
    return np.array([[0.02, contact, angle]]), np.array([travel / 0.02])


def size(displacement: Array) -> Array:
    return np.asarray(np.linalg.norm(displacement * IN_METRES, axis=-1))
