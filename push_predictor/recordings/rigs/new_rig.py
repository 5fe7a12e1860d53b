# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A rig from measured sizes. Values that are probably in another unit are refused by name."""

from __future__ import annotations

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.rig import Rig
from push_predictor.types import Array

SMALLEST, LARGEST = 0.001, 1.0  # m, of a slider
HEAVIEST = 100.0  # kg, of a slider
MOST_FRICTION = 5.0
LOAD = 0.01  # by which the sum of the load shares may differ from 1


def length_of(option: str, value: float) -> float:
    """The value if it is a slider's size in m. Raises RequestError that names the option and the likely unit."""
    if not SMALLEST <= value <= LARGEST:
        raise RequestError(option, value, f"metres from {SMALLEST:g} to {LARGEST:g}{_in_mm(value)}")
    return value


def new_rig(
    shape: str,
    outline: Outline,
    tip_radius: float,
    surface: str,
    mass: float | None = None,
    support_points: Array | None = None,
    contact_friction: float | None = None,
    surface_friction: float | None = None,
) -> Rig:
    """A rig with plausible values: lengths in m, mass in kg (None if unknown), support_points (k, 3) of x, y and load
    share.

    Raises RequestError that names the option, its value and the likely unit.
    """
    extent = float(np.max(np.ptp(outline.vertices, axis=0)))
    if not 0.0 < tip_radius <= extent / 2.0:
        accepted = f"metres above 0, at most half the slider's size ({extent / 2.0:g}){_in_mm(tip_radius)}"
        raise RequestError("--tip-radius", tip_radius, accepted)
    if mass is not None and not 0.0 < mass <= HEAVIEST:
        in_grams = f": {mass:g} g are {1e-3 * mass:g} kg" if HEAVIEST < mass < np.inf else ""
        raise RequestError("--mass", mass, f"kilograms above 0, at most {HEAVIEST:g}{in_grams}")
    for option, text in (("--surface", surface), ("--name", shape)):
        if not text.strip():
            raise RequestError(option, text, "a name")
    for option, friction in (("--contact-friction", contact_friction), ("--surface-friction", surface_friction)):
        if friction is not None and not 0.0 < friction <= MOST_FRICTION:
            raise RequestError(option, friction, f"a Coulomb coefficient above 0, at most {MOST_FRICTION:g}")
    if support_points is not None:
        _check_support(outline, support_points)
    return Rig(shape, outline, tip_radius, surface, mass, support_points, contact_friction, surface_friction)


def _check_support(outline: Outline, points: Array) -> None:
    outside = outline.project(points[:, :2]).distance > SMALLEST
    if outside.any():
        x, y = points[outside][0, :2].tolist()
        raise RequestError("--support-point", [x, y], f"x, y in metres inside the outline{_in_mm(max(abs(x), abs(y)))}")
    total = float(points[:, 2].sum())
    if np.any(points[:, 2] <= 0.0) or abs(total - 1.0) > LOAD:
        raise RequestError("--support-point", points[:, 2].tolist(), f"load shares above 0 with sum 1, not {total:g}")


def _in_mm(value: float) -> str:
    """The likely meaning of a length that is too large."""
    return f": {value:g} mm are {1e-3 * value:g} m" if LARGEST < value < np.inf else ""
