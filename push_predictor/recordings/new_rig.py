# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A new rig from measured sizes or the vertices of a polygon. Values that are probably in another unit are refused."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from push_predictor.errors import RequestError, RigError
from push_predictor.geometry.outline import SAME_LENGTH, Outline, signed_area
from push_predictor.geometry.shapes import transformed
from push_predictor.recordings.rig import Rig
from push_predictor.types import Array

SMALLEST, LARGEST = 0.001, 1.0  # m, of a slider
HEAVIEST = 100.0  # kg, of a slider
MOST_FRICTION = 5.0
LOAD = 0.01  # by which the sum of the load shares may differ from 1
LISTS = (".yaml", ".yml", ".json")
ROUND = 40  # vertices; more are probably a smooth curve
FILES = ("", ".csv", ".txt", *LISTS)
ACCEPTED = "at least three vertices x, y in metres, one a line or a list"
SYMMETRIES = {0: "every turn", 1: "none"}


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


def rig_lines(rig: Rig) -> list[str]:
    """Sizes in mm, mass, symmetry and first vertex."""
    outline = rig.outline
    low, high = outline.vertices.min(axis=0), outline.vertices.max(axis=0)
    x, y = (1e3 * (high - low)).tolist()
    corners = "a smooth curve" if outline.semi_axes is not None else f"{len(outline.vertices)} corners"
    order = outline.rotational_symmetry
    turns = SYMMETRIES.get(order, f"turns by {360.0 / order:g} degrees" if order else "")
    first = np.round(1e3 * outline.vertices[0], 2) + 0.0
    return [
        f"  extent         {x:.2f} mm along x, {y:.2f} mm along y, {corners}",
        f"  perimeter      {1e3 * outline.perimeter:.1f} mm, area {1e4 * outline.area:.2f} cm^2",
        f"  symmetry       {turns}",
        f"  contact 0      at ({first[0]:g}, {first[1]:g}) mm, contacts count counter-clockwise",
        f"  tip radius     {1e3 * rig.pusher_radius:.4g} mm",
        f"  mass           {'not given' if rig.object_mass is None else f'{rig.object_mass:g} kg'}",
    ]


@dataclass(frozen=True, eq=False)
class Polygon:
    """An outline, and the notes on what was changed or may be wrong. moved (2,): what was added to the vertices, m."""

    outline: Outline
    moved: Array
    notes: tuple[str, ...]


def read_polygon(path: Path, keep_origin: bool = False) -> Polygon:
    """Read the vertices, in their order around the outline; the origin moves to the centroid unless keep_origin.

    Clockwise vertices are reversed; a repeated vertex is dropped. Raises RigError that names file and line, vertex or
    side.
    """
    if path.suffix not in FILES:
        raise RigError(
            f"{path}: is not accepted, give a CSV with the columns x,y, or a YAML or JSON list of [x, y], in m"
        )
    vertices, notes = _from_list(path) if path.suffix in LISTS else _from_csv(path), []
    if signed_area(vertices) < 0.0:
        notes.append("the vertices run clockwise: their order was reversed")
        vertices = np.concatenate([vertices[:1], vertices[:0:-1]])
    repeated = np.linalg.norm(vertices - np.roll(vertices, -1, axis=0), axis=1) < SAME_LENGTH
    if repeated.any():
        notes.append(f"{int(repeated.sum())} repeated vertices were dropped")
    vertices = vertices[~repeated]
    _check(path, vertices)
    if len(vertices) > ROUND:
        notes.append(f"{len(vertices)} vertices: give a round slider by --circle or --ellipse, its normals are smooth")
    outline, moved = Outline(vertices), np.zeros(2)
    x, y = (1e3 * outline.centroid).tolist()
    if np.hypot(x, y) >= 1e3 * SAME_LENGTH:
        if keep_origin:
            notes.append(f"the centroid is at ({x:.2f}, {y:.2f}) mm, not at the origin")
        else:
            notes.append(
                f"the centroid ({x:.2f}, {y:.2f}) mm became the origin: the tracker must report the pose there"
            )
            moved = -outline.centroid
            outline = transformed(outline, shift=(float(moved[0]), float(moved[1])))
    return Polygon(outline, moved, tuple(notes))


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
            found = ",".join(row)[:40]
            raise RigError(f"{path}, line {number}: {found!r} is not accepted, give x,y in metres") from None
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
    if abs(signed_area(vertices)) < SMALLEST**2 / 4.0:
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
