# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Vertices of a polygon from a file: CSV with the columns x, y, or a YAML or JSON list of [x, y], in m."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from push_predictor.errors import RigError
from push_predictor.geometry.outline import SAME_LENGTH, Outline
from push_predictor.geometry.shapes import transformed
from push_predictor.recordings.rigs.new_rig import LARGEST, SMALLEST
from push_predictor.types import Array

LISTS = (".yaml", ".yml", ".json")
ROUND = 40  # vertices; more are probably a smooth curve
ACCEPTED = "at least three vertices x, y in metres, one a line or a list"


@dataclass(frozen=True, eq=False)
class Polygon:
    """An outline, and the notes on what was changed or may be wrong. moved (2,): what was added to the vertices, m."""

    outline: Outline
    moved: Array
    notes: tuple[str, ...]


def read_polygon(path: Path, keep_origin: bool = False) -> Polygon:
    """Read the vertices, in their order around the outline; the origin moves to the centroid unless keep_origin.

    Clockwise vertices are reversed; a repeated vertex is dropped. Raises RigError that names file and line or vertex.
    """
    vertices = _from_list(path) if path.suffix in LISTS else _from_csv(path)
    clockwise = ["the vertices run clockwise: their order was reversed"] if _area(vertices) < 0.0 else []
    return polygon_of(path, vertices, keep_origin, clockwise)


def polygon_of(path: Path, vertices: Array, keep_origin: bool, notes: Sequence[str] = ()) -> Polygon:
    """The polygon of vertices (n, 2) in m from a file, in either direction; notes: on what was found before.

    Raises RigError that names file and vertex or side.
    """
    repeated = np.linalg.norm(vertices - np.roll(vertices, -1, axis=0), axis=1) < SAME_LENGTH
    notes = [*notes, *([f"{int(repeated.sum())} repeated vertices were dropped"] if repeated.any() else [])]
    vertices = vertices[~repeated]
    _check(path, vertices)
    if _area(vertices) < 0.0:
        vertices = np.concatenate([vertices[:1], vertices[:0:-1]])
    if len(vertices) > ROUND:
        notes.append(f"{len(vertices)} vertices: give a round slider by --circle or --ellipse, its normals are smooth")
    return at_centroid(Outline(vertices), keep_origin, notes)


def at_centroid(outline: Outline, keep_origin: bool, notes: Sequence[str]) -> Polygon:
    """The outline with its centroid at the origin, unless keep_origin; the notes state what was moved."""
    x, y = (1e3 * outline.centroid).tolist()
    if float(np.hypot(x, y)) < 1e3 * SAME_LENGTH:
        return Polygon(outline, np.zeros(2), tuple(notes))
    if keep_origin:
        return Polygon(outline, np.zeros(2), (*notes, f"the centroid is at ({x:.2f}, {y:.2f}) mm, not at the origin"))
    moved = -outline.centroid
    note = f"the centroid ({x:.2f}, {y:.2f}) mm became the origin: the tracker must report the pose there"
    return Polygon(transformed(outline, shift=(float(moved[0]), float(moved[1]))), moved, (*notes, note))


def _from_csv(path: Path) -> Array:
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise RigError(f"{path}: the polygon cannot be read ({error})") from None
    rows: list[list[float]] = []
    heading = True  # the first line may name the columns
    for number, row in enumerate(csv.reader(lines), start=1):
        if not any(cell.strip() for cell in row) or row[0].lstrip().startswith("#"):
            continue
        try:
            x, y = (float(cell) for cell in row)
        except ValueError:
            if heading and [cell.strip().lower()[:1] for cell in row] == ["x", "y"]:
                heading = False
                continue
            raise RigError(f"{path}, line {number}: {','.join(row)!r} is not accepted, give x,y in metres") from None
        heading = False
        rows.append([x, y])
    return np.array(rows).reshape(-1, 2)


def _from_list(path: Path) -> Array:
    import yaml

    try:
        content = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise RigError(f"{path}: the polygon cannot be read ({error})") from None
    rows = content.get("outline") if isinstance(content, dict) else content
    try:
        vertices = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError):
        vertices = np.empty(0)
    if vertices.ndim != 2 or vertices.shape[1] != 2:
        raise RigError(f"{path}: contains no list of [x, y] (or a key outline with one), give {ACCEPTED}")
    return vertices


def _check(path: Path, vertices: Array) -> None:
    if len(vertices) < 3:
        raise RigError(f"{path}: {len(vertices)} different vertices are not accepted, give {ACCEPTED}")
    if not np.all(np.isfinite(vertices)):
        raise RigError(f"{path}: a vertex is not finite, give {ACCEPTED}")
    size = float(np.max(np.ptp(vertices, axis=0)))
    if not SMALLEST <= size <= LARGEST:
        unit = ": the file is probably in mm" if size > LARGEST else ""
        raise RigError(f"{path}: the polygon is {size:g} m large, give {SMALLEST:g} to {LARGEST:g} m{unit}")
    if (pair := _crossing(vertices)) is not None:
        raise RigError(
            f"{path}: sides {pair[0] + 1} and {pair[1] + 1} cross, give the vertices in order around the outline"
        )
    if abs(_area(vertices)) < SMALLEST**2 / 4.0:
        raise RigError(f"{path}: the polygon encloses nothing, give {ACCEPTED}")


def _crossing(vertices: Array) -> tuple[int, int] | None:
    """The first two sides that cross, None if none do."""
    start, end = vertices, np.roll(vertices, -1, axis=0)

    def side(points: Array) -> Array:
        """On which side of each edge (rows) the points (columns) lie."""
        along, offset = (end - start)[:, None], points[None] - start[:, None]
        return np.asarray(np.sign(along[..., 0] * offset[..., 1] - along[..., 1] * offset[..., 0]))

    apart = side(start) * side(end) < 0.0
    pairs = np.argwhere(apart & apart.T)
    return None if not len(pairs) else (int(pairs[0, 0]), int(pairs[0, 1]))


def _area(vertices: Array) -> float:
    x, y = vertices.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
