# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The outline in an SVG drawing: polygon, polyline, rect, circle, ellipse, or a path of straight segments.

The y axis of SVG points down: all is turned over, so that an outline seen from above stays as drawn.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from push_predictor.errors import RigError
from push_predictor.recordings.rigs.drawing import UNITS, Drawing, Oval, outline_of_drawing
from push_predictor.recordings.rigs.polygon_file import Polygon
from push_predictor.types import Array

UP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
UNSEEN = ("defs", "clipPath", "mask", "marker", "pattern", "symbol", "metadata", "title", "desc", "style", "namedview")
GROUPS = ("svg", "g", "a", "switch")
STRAIGHT = "MmLlHhVvZz"
UNEQUAL = 0.01  # relative difference of the scales along x and y


def read_svg(path: Path, unit: str | None = None, keep_origin: bool = False) -> Polygon:
    """Read the one closed outline; unit: a key of UNITS, the length of one unit of the drawing's coordinates.

    Without it, width in mm, cm, m or in together with viewBox give the scale. Raises RigError that names the file and
    what it contains.
    """
    try:
        root = ET.parse(path).getroot()
    except (OSError, ET.ParseError) as error:
        raise RigError(f"{path}: the SVG drawing cannot be read ({error})") from None
    if _kind(root) != "svg":
        raise RigError(f"{path}: is no SVG drawing, its first element is {_kind(root)!r}")
    drawing = Drawing(metres=None if unit else _metres(path, root))
    try:
        _collect(root, UP, drawing)
    except ValueError as error:
        raise RigError(f"{path}: {error}") from None
    return outline_of_drawing(path, drawing, unit, keep_origin)


def _metres(path: Path, root: ET.Element) -> float | None:
    """Length of one unit of the coordinates, m, None unless width and viewBox state it."""
    box = _numbers(root.get("viewBox", ""))
    width, height = (_length(root.get(name, "")) for name in ("width", "height"))
    if len(box) != 4 or box[2] <= 0.0 or width is None:
        return None
    scale = width / box[2]
    if height is not None and box[3] > 0.0 and abs(height / box[3] - scale) > UNEQUAL * scale:
        raise RigError(
            f"{path}: width, height and viewBox {root.get('viewBox')!r} scale x and y differently, give --unit"
        )
    return scale


def _length(text: str) -> float | None:
    """A length in m, None without a physical unit."""
    found = re.fullmatch(rf"\s*({NUMBER})\s*({'|'.join(UNITS)})\s*", text)
    return float(found[1]) * UNITS[found[2]] if found else None


def _collect(element: ET.Element, place: Array, drawing: Drawing) -> None:
    """Add what an element shows; place (3, 3): from its coordinates to those of the drawing, y upwards."""
    kind = _kind(element)
    if (
        kind in UNSEEN
        or element.get("display") == "none"
        or "display:none" in element.get("style", "").replace(" ", "")
    ):
        return
    place = place @ _transform(element.get("transform", ""))
    if kind in GROUPS:
        for child in element:
            _collect(child, place, drawing)
    elif kind in ("circle", "ellipse"):
        drawing.ovals.append(_oval(element, kind, place))
    elif kind in ("polygon", "polyline", "rect", "path"):
        for points, closed in _lines(element, kind):
            if closed:
                drawing.polygons.append(points @ place[:2, :2].T + place[:2, 2])
            else:
                drawing.others.append(f"{kind} that is not closed")
    else:
        drawing.others.append(kind)


def _oval(element: ET.Element, kind: str, place: Array) -> Oval:
    radii = [_value(element, name) for name in (("r", "r") if kind == "circle" else ("rx", "ry"))]
    centre = np.array([_value(element, "cx"), _value(element, "cy"), 1.0])
    return Oval((place @ centre)[:2], place[:2, :2] @ np.diag(radii))


def _lines(element: ET.Element, kind: str) -> list[tuple[Array, bool]]:
    """Points (n, 2) of each line of an element, and whether it is closed."""
    if kind == "path":
        return _subpaths(element.get("d", ""))
    if kind == "rect":
        if _value(element, "rx") or _value(element, "ry"):
            raise ValueError("a rect with rounded corners (rx, ry) is not accepted, give sharp corners")
        x, y, width, height = (_value(element, name) for name in ("x", "y", "width", "height"))
        return [(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]), True)]
    points = _points(_numbers(element.get("points", "")), f"points of a {kind}")
    return [(points, kind == "polygon" or _returns(points))]


def _subpaths(text: str) -> list[tuple[Array, bool]]:
    """The lines of a path's data. Raises ValueError for curves."""
    lines: list[tuple[Array, bool]] = []
    points: list[Array] = []
    start = here = np.zeros(2)

    def end(closed: bool) -> None:
        if len(points) > 1:
            whole = np.array(points)
            lines.append((whole, closed or _returns(whole)))
        points.clear()

    for command, rest in re.findall(r"([A-DF-Za-df-z])([^A-DF-Za-df-z]*)", text):
        if command not in STRAIGHT:
            raise ValueError(f"a path with the curve {command!r} is not accepted, give straight segments or an ellipse")
        if command in "Zz":
            end(closed=True)
            here = start
            continue
        for count, step in enumerate(_steps(command, _numbers(rest))):
            absolute = command.isupper()
            here = np.where(np.isnan(step), here, step if absolute else here + step)
            if command in "Mm" and count == 0:
                end(closed=False)
                start = here
            elif not points:
                points.append(start)
            points.append(here)
    end(closed=False)
    return lines


def _steps(command: str, numbers: list[float]) -> Array:
    """Rows of x, y that a command states; NaN where it states none."""
    if command in "Hh":
        return np.array([[number, np.nan] for number in numbers]).reshape(-1, 2)
    if command in "Vv":
        return np.array([[np.nan, number] for number in numbers]).reshape(-1, 2)
    return _points(numbers, f"path command {command}")


def _points(numbers: list[float], what: str) -> Array:
    if len(numbers) % 2:
        raise ValueError(f"{what}: {len(numbers)} numbers are not accepted, give pairs of x and y")
    return np.array(numbers).reshape(-1, 2)


def _returns(points: Array) -> bool:
    return len(points) > 2 and bool(np.allclose(points[0], points[-1], rtol=0.0, atol=1e-6 * np.ptp(points)))


def _transform(text: str) -> Array:
    """The matrix (3, 3) of a transform attribute. Raises ValueError for a kind that is not known."""
    whole = np.eye(3)
    for name, inside in re.findall(r"(\w+)\s*\(([^)]*)\)", text):
        whole = whole @ _matrix(name, _numbers(inside))
    return whole


def _matrix(name: str, numbers: list[float]) -> Array:
    if name == "matrix" and len(numbers) == 6:
        a, b, c, d, e, f = numbers
        return np.array([[a, c, e], [b, d, f], [0.0, 0.0, 1.0]])
    if name == "translate" and len(numbers) in (1, 2):
        return _moved(numbers[0], numbers[1] if len(numbers) == 2 else 0.0)
    if name == "scale" and len(numbers) in (1, 2):
        return np.diag([numbers[0], numbers[-1], 1.0])
    if name == "rotate" and len(numbers) in (1, 3):
        cos, sin = np.cos(np.radians(numbers[0])), np.sin(np.radians(numbers[0]))
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        x, y = numbers[1:] or (0.0, 0.0)
        return np.asarray(_moved(x, y) @ turn @ _moved(-x, -y))
    raise ValueError(f"transform {name}{tuple(numbers)} is not accepted, give matrix, translate, scale or rotate")


def _moved(x: float, y: float) -> Array:
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


def _value(element: ET.Element, name: str) -> float:
    """A number of an element, in the drawing's unit; 0 if it is missing."""
    text = element.get(name, "0")
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{_kind(element)} {name}={text!r} is not accepted, give a number without a unit") from None


def _numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(NUMBER, text)]


def _kind(element: ET.Element) -> str:
    return str(element.tag).rsplit("}", 1)[-1]
