# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rig of a recording: slider, pusher, surface; the push_rig record (docs/reference/rig_file.md)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from push_predictor.errors import RigError
from push_predictor.geometry.frames import to_body
from push_predictor.geometry.outline import CENTRED, Outline
from push_predictor.recordings.atomic import write_whole
from push_predictor.types import Array

RECORD_NAME = "push_rig"
REQUIRED = ("shape", "outline", "pusher_radius", "surface")
POSE = ("x", "y", "yaw")  # keys of shape_parameters: m, m, rad; a missing one is 0
HOW_TO_GIVE = "give it with --rig FILE.yaml or the node parameter 'rig'"


@dataclass(frozen=True, eq=False)
class Rig:
    """A slider, the pusher and the surface.

    pusher_radius in m; object_mass in kg, None if unknown: quasi-static motion does not depend on it. support_points:
    (k, 3) of x, y (m, body frame) and load share, or None. contact_friction and surface_friction are Coulomb
    coefficients, None if unknown.
    """

    shape: str
    outline: Outline
    pusher_radius: float
    surface: str
    object_mass: float | None = None
    support_points: Array | None = None
    contact_friction: float | None = None
    surface_friction: float | None = None

    def to_record(self) -> dict[str, str]:
        """The push_rig record, with strings only as required by MCAP metadata."""
        record = {
            "shape": self.shape,
            "outline": json.dumps(self.outline.vertices.tolist()),
            "pusher_radius": repr(float(self.pusher_radius)),
            "surface": self.surface,
        }
        if self.object_mass is not None:
            record["object_mass"] = repr(float(self.object_mass))
        if self.outline.semi_axes is not None:
            record["shape_parameters"] = json.dumps(_shape_parameters(self.outline))
        if self.support_points is not None:
            record["support_points"] = json.dumps(np.asarray(self.support_points).tolist())
        for key in ("contact_friction", "surface_friction"):
            if (value := getattr(self, key)) is not None:
                record[key] = repr(float(value))
        return record


def rig_from_record(record: Mapping[str, object], source: str) -> Rig:
    """Read a push_rig record; values are strings, or already parsed by YAML.

    Raises RigError that names the source, the key and how to give it.
    """
    if missing := [key for key in REQUIRED if key not in record]:
        raise RigError(f"{source}: push_rig lacks {', '.join(missing)}; {HOW_TO_GIVE}")
    support = record.get("support_points")
    return Rig(
        shape=str(record["shape"]),
        outline=_outline(record, source),
        pusher_radius=_positive(record, "pusher_radius", source),
        surface=str(record["surface"]),
        object_mass=_optional(record, "object_mass", source),
        support_points=None if support in (None, "") else _numbers(record, "support_points", 3, source),
        contact_friction=_optional(record, "contact_friction", source),
        surface_friction=_optional(record, "surface_friction", source),
    )


def load_rig(path: Path) -> Rig:
    """Read NAME.rig.yaml. Raises RigError if the file is missing or invalid."""
    import yaml

    try:
        record = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise RigError(f"{path}: the rig cannot be read ({error})") from None
    if not isinstance(record, dict):
        raise RigError(f"{path}: contains no rig, give the keys {', '.join(REQUIRED)}")
    return rig_from_record(record, str(path))


def save_rig(rig: Rig, path: Path) -> None:
    """Write NAME.rig.yaml. Raises OSError that names the path."""
    import yaml

    write_whole(path, yaml.safe_dump(rig.to_record(), sort_keys=False).encode())


def _shape_parameters(outline: Outline) -> dict[str, object]:
    a, b = outline.semi_axes or (0.0, 0.0)
    size = {"type": "circle", "radius": a} if a == b else {"type": "ellipse", "a": a, "b": b}
    return size if outline.pose == CENTRED else size | dict(zip(POSE, outline.pose, strict=True))


def _outline(record: Mapping[str, object], source: str) -> Outline:
    vertices = _numbers(record, "outline", 2, source)
    try:
        return Outline(vertices, *_smooth(record, vertices, source))
    except RigError as error:
        raise RigError(f"{source}: push_rig {error}") from None


def _smooth(
    record: Mapping[str, object], vertices: Array, source: str
) -> tuple[tuple[float, float] | None, tuple[float, float, float]]:
    """Semi-axes of a circle or an ellipse, m, None for a polygon, and the pose of the axes, m, rad."""
    parameters = _parsed(record, "shape_parameters", source)
    if not isinstance(parameters, dict):
        return None, CENTRED
    try:
        x, y, yaw = (float(parameters.get(key, 0.0)) for key in POSE)
        if not np.all(np.isfinite([x, y, yaw])):
            raise ValueError("x, y or yaw is not finite")
        own = to_body(vertices, np.array([x, y, yaw]))
        if parameters["type"] == "circle":
            return (float(parameters["radius"]), float(parameters["radius"])), (x, y, yaw)
        if parameters["type"] == "ellipse":
            return (_half(float(parameters["a"]), own[:, 0]), _half(float(parameters["b"]), own[:, 1])), (x, y, yaw)
    except (KeyError, TypeError, ValueError) as error:
        raise RigError(f"{source}: push_rig shape_parameters {parameters!r} lacks a number ({error})") from None
    raise RigError(f"{source}: push_rig shape_parameters type {parameters['type']!r}, give 'circle' or 'ellipse'")


def _half(axis: float, coordinates: Array) -> float:
    """The semi-axis: records contain semi-axes or full axes, the vertices show which."""
    reach = float(np.max(np.abs(coordinates)))
    return axis if abs(axis - reach) <= abs(axis / 2.0 - reach) else axis / 2.0


def _parsed(record: Mapping[str, object], key: str, source: str) -> object:
    value = record.get(key)
    if not isinstance(value, str) or not value.strip():
        return value
    try:
        parsed: object = json.loads(value)
    except ValueError as error:
        raise RigError(f"{source}: push_rig {key} is not JSON ({error})") from None
    return parsed


def _numbers(record: Mapping[str, object], key: str, width: int, source: str) -> Array:
    try:
        rows = np.array(_parsed(record, key, source), dtype=np.float64)
    except (TypeError, ValueError):
        rows = np.empty((0,))
    if rows.ndim != 2 or rows.shape[1] != width or not np.all(np.isfinite(rows)):
        raise RigError(f"{source}: push_rig {key} {str(record[key])[:60]!r}, give a list of {width} numbers each")
    return rows


def _positive(record: Mapping[str, object], key: str, source: str) -> float:
    try:
        value = float(str(record[key]))
    except ValueError:
        value = float("nan")
    if not (np.isfinite(value) and value > 0.0):
        raise RigError(f"{source}: push_rig {key} {record[key]!r}, give a number above 0 in SI units")
    return value


def _optional(record: Mapping[str, object], key: str, source: str) -> float | None:
    return None if record.get(key) in (None, "") else _positive(record, key, source)
