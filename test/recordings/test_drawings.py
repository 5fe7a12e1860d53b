# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The outline in an SVG or DXF drawing becomes that of a rig, and what is no single closed outline is refused."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from push_predictor.cli import main
from push_predictor.errors import RigError
from push_predictor.recordings.rig import load_rig
from push_predictor.recordings.rigs.drawing import Drawing, outline_of_drawing
from push_predictor.recordings.rigs.dxf_file import INSUNITS, read_dxf
from push_predictor.recordings.rigs.polygon_file import Polygon
from push_predictor.recordings.rigs.svg_file import read_svg

PAGE = 'width="200mm" height="100mm" viewBox="0 0 200 100"'
# An L whose long side is at the left and whose foot points to the right, seen in the drawing: y down in SVG.
ELL = "10,10 30,10 30,50 70,50 70,70 10,70"
SEEN = np.array([[10.0, -10.0], [10.0, -70.0], [70.0, -70.0], [70.0, -50.0], [30.0, -50.0], [30.0, -10.0]])
PATHS = {
    "absolute": "M 10,10 L 30,10 30,50 70,50 70,70 10,70 Z",
    "relative": "m10 10l20 0 0 40 40 0 0 20-60 0z",
    "implicit": "m 10,10 20,0 0,40 40,0 0,20 -60,0 z",
    "along the axes": "M10 10H30V50H70V70H10Z",
    "along the axes, relative": "M10 10h20v40h40v20h-60v-60",
    "exponents": "M1e1,1E1 L3e+1,10 30,5e1 70,50 70,70 10,70 z",
}


def svg(tmp_path: Path, inside: str, page: str = PAGE) -> Path:
    (tmp_path / "part.svg").write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {page}>{inside}</svg>')
    return tmp_path / "part.svg"


def same_polygon(found: Polygon, vertices: np.ndarray) -> bool:
    """Whether the outline has these vertices, m, in this direction from any of them."""
    start = int(np.argmin(np.linalg.norm(vertices - found.outline.vertices[0], axis=1)))
    turned = np.roll(vertices, -start, axis=0)
    return turned.shape == found.outline.vertices.shape and np.allclose(found.outline.vertices, turned, atol=1e-9)


def ell_at_centroid() -> np.ndarray:
    x, y = (20 * 60 * 10 + 40 * 20 * 40) / 2000 + 10, (20 * 60 * 30 + 40 * 20 * 50) / 2000 + 10
    return 1e-3 * (SEEN - [x, -y])


@pytest.mark.parametrize(
    "inside",
    [f'<polygon points="{ELL}"/>', f'<polyline points="{ELL} 10,10"/>', *(f'<path d="{d}"/>' for d in PATHS.values())],
)
def test_an_outline_of_straight_sides_is_as_drawn_and_no_mirror_image(tmp_path: Path, inside: str) -> None:
    found = read_svg(svg(tmp_path, inside))
    assert same_polygon(found, ell_at_centroid())
    assert len(found.notes) == 1 and "became the origin" in found.notes[0]


def test_the_direction_of_the_drawing_does_not_matter(tmp_path: Path) -> None:
    backwards = " ".join(reversed(ELL.split()))
    assert same_polygon(read_svg(svg(tmp_path, f'<polygon points="{backwards}"/>')), ell_at_centroid())


def test_the_origin_of_a_drawing_may_stay(tmp_path: Path) -> None:
    found = read_svg(svg(tmp_path, f'<polygon points="{ELL}"/>'), keep_origin=True)
    assert same_polygon(found, 1e-3 * SEEN)
    assert "not at the origin" in found.notes[0]


@pytest.mark.parametrize(
    ("page", "unit", "metres"),
    [
        (PAGE, None, 0.001),
        ('width="20cm" viewBox="0 0 200 100"', None, 0.001),
        ('width="400mm" height="200mm" viewBox="0 0 200 100"', None, 0.002),
        ('viewBox="0 0 200 100"', "mm", 0.001),
        ('width="200mm"', "mm", 0.001),
        (PAGE, "in", 0.0254),
    ],
)
def test_width_and_view_box_or_the_unit_give_the_scale(
    tmp_path: Path, page: str, unit: str | None, metres: float
) -> None:
    outline = read_svg(svg(tmp_path, '<rect x="3" y="4" width="9" height="6"/>', page), unit).outline
    assert np.ptp(outline.vertices, axis=0) == pytest.approx([9 * metres, 6 * metres])
    assert outline.centroid == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(
    ("inside", "axes", "yaw"),
    [
        ('<circle cx="50" cy="50" r="30"/>', (0.03, 0.03), 0.0),
        ('<ellipse cx="50" cy="50" rx="40" ry="20"/>', (0.04, 0.02), 0.0),
        ('<ellipse cx="50" cy="50" rx="20" ry="40"/>', (0.02, 0.04), 0.0),
        ('<ellipse rx="40" ry="20" transform="translate(50 50) rotate(30)"/>', (0.04, 0.02), -np.pi / 6.0),
        ('<circle r="20" transform="matrix(2 0 0 1 50 50)"/>', (0.04, 0.02), 0.0),
    ],
)
def test_a_circle_or_an_ellipse_stays_smooth(
    tmp_path: Path, inside: str, axes: tuple[float, float], yaw: float
) -> None:
    """A turn of 30 degrees in SVG is clockwise, as drawn."""
    outline = read_svg(svg(tmp_path, inside)).outline
    assert outline.semi_axes == pytest.approx(axes)
    assert outline.pose == pytest.approx((0.0, 0.0, yaw), abs=1e-9)
    assert outline.project(outline.vertices).distance == pytest.approx(0.0, abs=1e-9)


def test_groups_and_transforms_place_the_outline(tmp_path: Path) -> None:
    """A scale by -1 along y turns the drawing over: the L then is its mirror image, as seen in the drawing."""
    shown = f'<g transform="translate(5,7)"><g transform="scale(2)"><polygon points="{ELL}"/></g></g>'
    assert same_polygon(read_svg(svg(tmp_path, shown)), 2.0 * ell_at_centroid())
    turned = f'<polygon points="{ELL}" transform="rotate(90 20 30)"/>'  # clockwise, as drawn
    clockwise = ell_at_centroid() @ np.array([[0.0, -1.0], [1.0, 0.0]])
    assert same_polygon(read_svg(svg(tmp_path, turned)), clockwise)
    over = read_svg(svg(tmp_path, f'<polygon points="{ELL}" transform="scale(1,-1)"/>'))
    assert same_polygon(over, (ell_at_centroid() * [1.0, -1.0])[::-1])


def test_transforms_of_one_element_apply_from_the_right(tmp_path: Path) -> None:
    shown = f'<polygon points="{ELL}" transform="translate(10) scale(2)"/>'
    assert same_polygon(read_svg(svg(tmp_path, shown), keep_origin=True), 1e-3 * (2.0 * SEEN + [10.0, 0.0]))


def test_a_given_unit_replaces_that_of_the_drawing() -> None:
    drawing = Drawing(polygons=[SEEN], metres=0.001)
    assert same_polygon(outline_of_drawing(Path("part.dxf"), drawing, "cm", True), 0.01 * SEEN)


def test_what_is_not_shown_is_ignored(tmp_path: Path) -> None:
    hidden = '<rect width="5" height="5" display="none"/><circle r="3" style="fill:red; display: none"/>'
    unused = '<defs><circle r="3"/></defs><title>a part</title>'
    found = read_svg(svg(tmp_path, f'{hidden}{unused}<polygon points="{ELL}"/>'))
    assert same_polygon(found, ell_at_centroid())


@pytest.mark.parametrize(
    ("inside", "page", "message"),
    [
        (f'<polygon points="{ELL}"/>', "", "states no unit of length, give it with --unit {mm,cm,m,in}"),
        (f'<polygon points="{ELL}"/>', 'width="200mm"', "--unit"),
        (f'<polygon points="{ELL}"/>', 'width="200" viewBox="0 0 200 100"', "--unit"),
        (f'<polygon points="{ELL}"/>', 'width="2cm" height="9cm" viewBox="0 0 20 10"', "scale x and y differently"),
        ("", PAGE, "contains no outline"),
        ('<circle r="9"/><circle r="4"/>', PAGE, "contains 2 x circle or ellipse"),
        (f'<polygon points="{ELL}"/><line x1="1"/><text>a</text>', PAGE, "1 x closed polygon, 1 x line, 1 x text"),
        (f'<polyline points="{ELL}"/>', PAGE, "1 x polyline that is not closed"),
        ('<path d="M1 1H9V9"/>', PAGE, "1 x path that is not closed"),
        ('<path d="M1 1H9V9Z M2 2H3V3Z"/>', PAGE, "2 x closed polygon"),
        ('<path d="M1 1C2 2 3 3 4 4Z"/>', PAGE, "the curve 'C' is not accepted, give straight segments"),
        ('<rect width="9" height="9" rx="1"/>', PAGE, "rounded corners"),
        ('<rect width="9mm" height="9"/>', PAGE, "rect width='9mm' is not accepted, give a number without a unit"),
        ('<polygon points="1,1 9,1 9"/>', PAGE, "points of a polygon: 5 numbers are not accepted"),
        (f'<polygon points="{ELL}" transform="skewX(3)"/>', PAGE, "transform skewX(3.0,) is not accepted"),
        ('<circle r="9000"/>', PAGE, "18 x 18 m large"),
        ('<rect width="9000" height="9"/>', PAGE, "9 m large"),
        ("<unclosed>", PAGE, "the SVG drawing cannot be read"),
    ],
)
def test_what_is_no_single_closed_outline_is_named(tmp_path: Path, inside: str, page: str, message: str) -> None:
    path = svg(tmp_path, inside, page)
    with pytest.raises(RigError) as error:
        read_svg(path)
    assert message in str(error.value) and str(error.value).startswith(str(path))


def test_another_kind_of_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "page.svg").write_text("<html/>")
    with pytest.raises(RigError, match="is no SVG drawing, its first element is 'html'"):
        read_svg(tmp_path / "page.svg")


def test_the_command_writes_the_rig_of_a_drawing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    measured = ["--tip-radius", "0.005", "--surface", "abs", "--out", str(tmp_path / "rig.yaml")]
    assert main(["rig", "--svg", str(svg(tmp_path, '<circle r="45"/>', "")), "--unit", "mm", *measured]) == 0
    rig = load_rig(tmp_path / "rig.yaml")
    assert (rig.shape, rig.outline.semi_axes) == ("part", (0.045, 0.045))
    assert main(["rig", "--square", "0.09", "--unit", "mm", *measured, "--force"]) == 1
    assert "--unit: 'mm' is not accepted, give it only with --svg or --dxf" in capsys.readouterr().err


# --- DXF -------------------------------------------------------------------------------------------------------------


def test_without_ezdxf_the_error_names_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with pytest.raises(RigError, match=r"DXF drawings need the package ezdxf \(pip install ezdxf\)"):
        read_dxf(tmp_path / "part.dxf")


def dxf(tmp_path: Path, *parts: tuple[str, list[object], dict[str, object]], units: int = 4) -> Path:
    """A drawing of entities: the method of the model space, its arguments and its keywords."""
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed: the DXF reader is NOT tested")
    document = ezdxf.new()
    document.header["$INSUNITS"] = units
    space = document.modelspace()
    for kind, arguments, keywords in parts:
        getattr(space, f"add_{kind}")(*arguments, **keywords)
    document.saveas(tmp_path / "part.dxf")
    return tmp_path / "part.dxf"


UP = [(float(x), float(y)) for x, y in SEEN]  # y of DXF points up
CLOSED: dict[str, object] = {"close": True}


@pytest.mark.parametrize(
    "parts",
    [
        [("lwpolyline", [UP], CLOSED)],
        [("lwpolyline", [[*UP, UP[0]]], {})],
        [("polyline2d", [UP], CLOSED)],
        [("line", [UP[k], UP[(k + 1) % 6]], {}) for k in (0, 3, 1, 5, 4, 2)],
        [("line", [UP[(k + k % 2) % 6], UP[(k + 1 - k % 2) % 6]], {}) for k in range(6)],
        [("lwpolyline", [UP[::-1]], CLOSED), ("text", ["a note"], {}), ("point", [(1, 1)], {})],
        [("lwpolyline", [[(-x, y) for x, y in UP]], {"close": True, "dxfattribs": {"extrusion": (0, 0, -1)}})],
    ],
)
def test_an_outline_of_a_dxf_drawing_is_as_drawn(
    tmp_path: Path, parts: list[tuple[str, list[object], dict[str, object]]]
) -> None:
    assert same_polygon(read_dxf(dxf(tmp_path, *parts)), ell_at_centroid())


@pytest.mark.parametrize(
    ("part", "axes", "yaw"),
    [
        (("circle", [(5.0, 5.0), 30.0], {}), (0.03, 0.03), 0.0),
        (("ellipse", [(5.0, 5.0), (40.0, 0.0), 0.5], {}), (0.04, 0.02), 0.0),
        (("ellipse", [(5.0, 5.0), (0.0, 40.0), 0.5], {}), (0.02, 0.04), 0.0),
        (("ellipse", [(0.0, 0.0), (30.0, 30.0), 0.5], {}), (0.03 * 2**0.5, 0.015 * 2**0.5), np.pi / 4.0),
    ],
)
def test_a_round_outline_of_a_dxf_drawing_stays_smooth(
    tmp_path: Path, part: tuple[str, list[object], dict[str, object]], axes: tuple[float, float], yaw: float
) -> None:
    outline = read_dxf(dxf(tmp_path, part)).outline
    assert outline.semi_axes == pytest.approx(axes)
    assert outline.pose == pytest.approx((0.0, 0.0, yaw), abs=1e-9)


def test_the_unit_of_a_dxf_drawing_is_read_or_given(tmp_path: Path) -> None:
    for units, metres in INSUNITS.items():
        outline = read_dxf(
            dxf(tmp_path, ("circle", [(0.0, 0.0), 4.0 if metres < 0.1 else 0.4], {}), units=units)
        ).outline
        radius = (4.0 if metres < 0.1 else 0.4) * metres
        assert outline.semi_axes == pytest.approx((radius, radius))
    without = dxf(tmp_path, ("circle", [(0.0, 0.0), 3.0], {}), units=0)
    with pytest.raises(RigError, match="states no unit of length"):
        read_dxf(without)
    assert read_dxf(without, "cm").outline.semi_axes == pytest.approx((0.03, 0.03))


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ([("lwpolyline", [UP], {})], "1 x LWPOLYLINE that is not closed"),
        ([("lwpolyline", [[(0, 0, 0, 0, 0.5), (9, 0, 0, 0, 0), (9, 9, 0, 0, 0)]], CLOSED)], "1 x LWPOLYLINE with arcs"),
        ([("line", [UP[k], UP[k + 1]], {}) for k in range(4)], "4 x LINE in no closed chain"),
        ([("circle", [(0, 0), 9.0], {}), ("circle", [(0, 0), 3.0], {})], "2 x circle or ellipse"),
        ([("lwpolyline", [UP], CLOSED), ("arc", [(0, 0), 3.0, 0.0, 90.0], {})], "1 x closed polygon, 1 x ARC"),
        ([("ellipse", [(0, 0), (9.0, 0.0), 0.5, 0.0, 2.0], {})], "1 x ELLIPSE that is not closed"),
    ],
)
def test_what_is_no_single_closed_outline_of_a_dxf_drawing_is_named(
    tmp_path: Path, parts: list[tuple[str, list[object], dict[str, object]]], message: str
) -> None:
    with pytest.raises(RigError, match=message):
        read_dxf(dxf(tmp_path, *parts))


def test_a_dxf_file_that_is_none_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("ezdxf", reason="ezdxf is not installed: the DXF reader is NOT tested")
    (tmp_path / "part.dxf").write_text("nothing")
    for path in (tmp_path / "part.dxf", tmp_path / "nowhere.dxf"):
        with pytest.raises(RigError, match=r"\.dxf: the DXF drawing cannot be read"):
            read_dxf(path)
