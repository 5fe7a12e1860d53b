# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The outline in a DXF drawing: LWPOLYLINE, POLYLINE, a chain of LINEs, CIRCLE or ELLIPSE in the model space."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.errors import RigError
from push_predictor.recordings.rigs.drawing import Drawing, Oval, outline_of_drawing
from push_predictor.recordings.rigs.polygon_file import Polygon
from push_predictor.types import Array

if TYPE_CHECKING:
    from types import ModuleType

MISSING = "DXF drawings need the package ezdxf (pip install ezdxf); or export the drawing as SVG and give --svg"
INSUNITS = {1: 0.0254, 4: 0.001, 5: 0.01, 6: 1.0}  # values of $INSUNITS, m
NOTES = ("TEXT", "MTEXT", "DIMENSION", "LEADER", "MULTILEADER", "POINT")  # of a drawing, not of the part
JOINED = 1e-6  # of the drawing's size: ends of lines that are the same point


def read_dxf(path: Path, unit: str | None = None, keep_origin: bool = False) -> Polygon:
    """Read the one closed outline; unit: a key of UNITS in place of the drawing's own ($INSUNITS).

    Raises RigError that names the file and what it contains, or the package that is missing.
    """
    ezdxf = _package()
    try:
        document = ezdxf.readfile(str(path))
    except (OSError, UnicodeDecodeError, ezdxf.DXFError) as error:
        raise RigError(f"{path}: the DXF drawing cannot be read ({error})") from None
    drawing = Drawing(metres=INSUNITS.get(int(document.header.get("$INSUNITS", 0))))
    lines: list[Array] = []
    for entity in document.modelspace():
        _add(entity, drawing, lines)
    _chain(lines, drawing)
    return outline_of_drawing(path, drawing, unit, keep_origin)


def _package() -> ModuleType:
    try:
        import ezdxf
    except ImportError:
        raise RigError(MISSING) from None
    return ezdxf  # type: ignore[no-any-return]  # Any where the optional package is missing


def _add(entity: Any, drawing: Drawing, lines: list[Array]) -> None:
    kind = str(entity.dxftype())
    if kind == "LINE":
        lines.append(_flat([entity.dxf.start, entity.dxf.end]))
    elif kind in POLYLINES:
        points, closed, curved = POLYLINES[kind](entity)
        if curved or not (closed or _same(points[0], points[-1], points)):
            drawing.others.append(f"{kind} {'with arcs' if curved else 'that is not closed'}")
        else:
            drawing.polygons.append(points)
    elif kind == "CIRCLE":
        radius = float(entity.dxf.radius)
        drawing.ovals.append(Oval(_flat([entity.ocs().to_wcs(entity.dxf.center)])[0], radius * np.eye(2)))
    elif kind == "ELLIPSE" and abs(entity.dxf.end_param - entity.dxf.start_param) > 2.0 * np.pi - JOINED:
        axes = _flat([entity.dxf.major_axis, entity.minor_axis]).T
        drawing.ovals.append(Oval(_flat([entity.dxf.center])[0], axes))
    elif kind not in NOTES:
        drawing.others.append("ELLIPSE that is not closed" if kind == "ELLIPSE" else kind)


def _lightweight(entity: Any) -> tuple[Array, bool, bool]:
    bulges = [point[0] for point in entity.get_points("b")]
    return _flat(entity.vertices_in_wcs()), bool(entity.closed), any(bulges)


def _heavy(entity: Any) -> tuple[Array, bool, bool]:
    curved = any(vertex.dxf.bulge for vertex in entity.vertices)
    return _flat(entity.points_in_wcs()), bool(entity.is_closed), curved


POLYLINES: dict[str, Callable[[Any], tuple[Array, bool, bool]]] = {"LWPOLYLINE": _lightweight, "POLYLINE": _heavy}


def _flat(points: Iterable[Any]) -> Array:
    """Points (n, 2) of vectors in space."""
    return np.array([[float(point[0]), float(point[1])] for point in points]).reshape(-1, 2)


def _chain(lines: list[Array], drawing: Drawing) -> None:
    """Join lines (2, 2) end to end to closed polygons; what does not close is no outline."""
    rest = list(lines)
    whole = np.concatenate(lines) if lines else np.zeros((1, 2))
    while rest:
        chain = list(rest.pop())
        while (found := _next(chain[-1], rest, whole)) is not None:
            chain.append(found)
        if len(chain) > 3 and _same(chain[0], chain[-1], whole):
            drawing.polygons.append(np.array(chain))
        else:
            drawing.others.extend(["LINE in no closed chain"] * (len(chain) - 1))


def _next(end: Array, rest: list[Array], whole: Array) -> Array | None:
    """The other end of a line that begins or ends at a point; the line is removed."""
    for index, (first, last) in enumerate(rest):
        if _same(first, end, whole) or _same(last, end, whole):
            del rest[index]
            return np.asarray(last if _same(first, end, whole) else first)
    return None


def _same(one: Array, other: Array, whole: Array) -> bool:
    """Whether two points are the same in a drawing of the size of points (n, 2)."""
    return bool(np.linalg.norm(one - other) <= JOINED * np.linalg.norm(np.ptp(whole, axis=0)))
