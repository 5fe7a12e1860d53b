# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The command `rig`: a rig file from sizes, its summary, its picture, and what it refuses."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from repository import REPOSITORY

from push_predictor.cli import main
from push_predictor.geometry.shapes import shape_outline
from push_predictor.recordings.rig import Rig, load_rig

ROUND_BAG = str(REPOSITORY / "bags" / "circle_pu")
EXCHANGED = ["--slider-topic", "pusher/pose", "--pusher-topic", "slider/pose"]
MEASURED = ["--tip-radius", "0.00475", "--surface", "plywood", "--mass", "0.8"]
CENTRE = ["--support-point", "0", "0", "0.5"]


def made(tmp_path: Path, *arguments: str) -> Rig:
    out = tmp_path / "rig.yaml"
    assert main(["rig", *arguments, *MEASURED, "--out", str(out), "--force"]) == 0
    return load_rig(out)


def refused(capsys: pytest.CaptureFixture[str], tmp_path: Path, *arguments: str) -> str:
    assert main(["rig", *arguments, "--out", str(tmp_path / "refused.yaml")]) == 1
    assert not (tmp_path / "refused.yaml").exists()
    return capsys.readouterr().err.strip()


def polygon_file(tmp_path: Path, text: str, name: str = "base.csv") -> str:
    (tmp_path / name).write_text(text)
    return str(tmp_path / name)


@pytest.mark.parametrize(
    ("arguments", "shape"),
    [
        (["--square", "0.09"], "rect1"),
        (["--rectangle", "0.09", "0.09"], "rect1"),
        (["--circle", "0.105"], "ellip1"),
        (["--ellipse", "0.13089", "0.105"], "ellip2"),
    ],
)
def test_sizes_are_those_that_a_caliper_measures(tmp_path: Path, arguments: list[str], shape: str) -> None:
    rig, outline = made(tmp_path, *arguments), shape_outline(shape)
    np.testing.assert_allclose(rig.outline.vertices, outline.vertices, atol=1e-12)
    assert rig.outline.semi_axes == pytest.approx(outline.semi_axes) if outline.semi_axes else True
    assert (rig.shape, rig.surface) == (arguments[0].strip("-"), "plywood")
    assert (rig.pusher_radius, rig.object_mass) == (0.00475, 0.8)


def test_a_rig_needs_no_mass(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The command of the specification, and the checks of a recording with the rig that it writes."""
    out = tmp_path / "rig.yaml"
    call = ["rig", "--square", "0.09", "--tip-radius", "0.00475", "--surface", "plywood", "--out", str(out)]
    assert main(call) == 0
    assert "mass           not given" in capsys.readouterr().out
    assert load_rig(out).object_mass is None and "object_mass" not in out.read_text()
    assert main(["rig", "--circle", "0.105", *call[3:], "--force"]) == 0
    assert main(["check", ROUND_BAG, "--rig", str(out), "--strict"]) == 0
    assert main(["info", ROUND_BAG, "--rig", str(out)]) == 0
    assert "circle on plywood, mass not given" in capsys.readouterr().out


def test_a_rectangle_is_wide_along_x_and_what_is_known_of_friction_and_support_is_kept(tmp_path: Path) -> None:
    feet = ["--support-point", "0.03", "0", "0.5", "--support-point", "-0.03", "0", "0.5"]
    rig = made(tmp_path, "--rectangle", "0.12", "0.05", *feet, "--contact-friction", "0.2", "--surface-friction", "0.3")
    assert np.ptp(rig.outline.vertices, axis=0) == pytest.approx([0.12, 0.05])
    assert rig.support_points is not None
    np.testing.assert_allclose(rig.support_points, [[0.03, 0.0, 0.5], [-0.03, 0.0, 0.5]])
    assert (rig.contact_friction, rig.surface_friction) == (0.2, 0.3)


# --- polygons --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("base.csv", "x,y\n0,0\n0.12,0\n0,0.06\n"),
        ("bare.csv", "# corners\n0,0\n0.12,0\n0,0.06\n\n0,0\n"),
        ("clockwise.csv", "x_m,y_m\n0,0\n0,0.06\n0.12,0\n"),
        ("base.yaml", "- [0, 0]\n- [0.12, 0]\n- [0, 0.06]\n"),
        ("base.json", '{"outline": [[0, 0], [0.12, 0], [0, 0.06]]}'),
    ],
)
def test_a_polygon_is_read_and_its_centroid_becomes_the_origin(tmp_path: Path, name: str, text: str) -> None:
    rig = made(tmp_path, "--polygon", polygon_file(tmp_path, text, name))
    np.testing.assert_allclose(rig.outline.vertices, [[-0.04, -0.02], [0.08, -0.02], [-0.04, 0.04]], atol=1e-12)
    assert rig.shape == Path(name).stem


def test_the_origin_of_a_polygon_may_stay_and_feet_move_with_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = polygon_file(tmp_path, "0,0\n0.12,0\n0,0.06\n")
    foot = ["--support-point", "0.04", "0.02", "1"]
    moved = made(tmp_path, "--polygon", file, *foot)
    assert "the centroid (40.00, 20.00) mm became the origin" in capsys.readouterr().out
    kept = made(tmp_path, "--polygon", file, "--keep-origin", *foot)
    assert "not at the origin" in capsys.readouterr().out
    assert moved.support_points is not None and kept.support_points is not None
    assert kept.outline.vertices[0] == pytest.approx([0.0, 0.0])
    assert moved.support_points[0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
    assert kept.support_points[0] == pytest.approx([0.04, 0.02, 1.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *((text, "base.") for text in ("outline: 3", "[[1, 2, 3]]", "[a, b", "{}")),
        ("0,0\n120,0\n0,60\n", "120 m large, give 0.001 to 1 m: the file is probably in mm"),
        ("0,0\n0.1,0\n0.1,abc\n", "line 3: '0.1,abc' is not accepted, give x,y in metres"),
        ("x,y\nx,y\n0,0\n", "line 2"),
        ("0,0\n0.1,0\n", "2 different vertices"),
        ("0,0\n0.1,0\n0,nan\n", "not finite"),
        ("0,0\n0.1,0.1\n0.1,0\n0,0.1\n", "sides 1 and 3 cross"),
        ("0,0\n0.1,0\n0.2,0\n", "encloses nothing"),
    ],
)
def test_a_wrong_polygon_is_refused_with_its_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    file = polygon_file(tmp_path, text, "base.yaml" if message == "base." else "base.csv")
    error = refused(capsys, tmp_path, "--polygon", file, *MEASURED)
    assert file in error and message in error


def test_a_polygon_that_is_round_is_noted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [f"{0.05 * np.cos(t):.6f},{0.05 * np.sin(t):.6f}" for t in np.arange(60) * 2 * np.pi / 60]
    made(tmp_path, "--polygon", polygon_file(tmp_path, "\n".join(rows)))
    assert "--circle or --ellipse" in capsys.readouterr().out


# --- refusals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--square", "90"], "--square: 90.0 is not accepted, give metres from 0.001 to 1: 90 mm are 0.09 m"),
        (["--ellipse", "0.13", "105"], "--ellipse: 105.0"),
        (["--circle", "-0.1"], "--circle: -0.1"),
        (["--square", "nan"], "--square: nan"),
        (
            ["--square", "0.09", "--tip-radius", "4.75"],
            "--tip-radius: 4.75 is not accepted, give metres above 0, at most half",
        ),
        (["--square", "0.09", "--tip-radius", "0.046"], "--tip-radius: 0.046"),
        (["--square", "0.09", "--tip-radius", "0"], "--tip-radius: 0.0"),
        (["--square", "0.09", "--mass", "800"], "800 g are 0.8 kg"),
        (["--square", "0.09", "--mass", "-1"], "--mass: -1.0"),
        (["--square", "0.09", "--surface", " "], "--surface: ' '"),
        (["--square", "0.09", "--contact-friction", "0"], "--contact-friction: 0.0"),
        (["--square", "0.09", *CENTRE, "--support-point", "30", "0", "0.5"], "--support-point: [30.0, 0.0]"),
        (["--square", "0.09", "--support-point", "0.03", "0", "0.9"], "sum 1, not 0.9"),
        (["--square", "0.09", "--keep-origin"], "--keep-origin"),
        (["--square", "0.09", "--picture", "rig.png"], "ends with .svg"),
        (["--rig", "rig.yaml", "--square", "0.09"], "--rig"),
        (["--polygon", "nowhere.csv"], "nowhere.csv: the polygon cannot be read"),
        (
            ["--polygon", "base.svg"],
            "base.svg: is not accepted, give a CSV with the columns x,y, or a YAML or JSON list",
        ),
    ],
)
def test_a_bad_value_is_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert message in refused(capsys, tmp_path, *MEASURED, *arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--square", "0.09", "--surface", "plywood"], "--tip-radius"),
        (["--square", "0.09", "--tip-radius", "0.00475"], "--surface"),
        (["--from", ROUND_BAG, "--mass", "0.8"], "--mass"),
        (["--from", "nowhere"], "nowhere: no such file or folder"),
        (["--from", ROUND_BAG, "--slider-topic", "nothing"], "nothing"),
        (
            ["--from", ROUND_BAG, *EXCHANGED],
            f"{ROUND_BAG}: no rig can be estimated (topics_swapped): Slider and",
        ),
    ],
)
def test_what_is_missing_or_would_not_be_used_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert message in refused(capsys, tmp_path, *arguments)


# --- output ----------------------------------------------------------------------------------------------------------


def test_the_json_contains_the_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made(tmp_path, "--square", "0.09", "--json", "-")
    content = json.loads(capsys.readouterr().out)
    assert content["record"]["pusher_radius"] == "0.00475" and content["notes"] == []


def test_the_picture_is_to_scale(tmp_path: Path) -> None:
    picture = tmp_path / "rig.svg"
    made(tmp_path, "--square", "0.09", "--name", "a <b>", "--picture", str(picture))
    tree = ET.parse(picture).getroot()
    space = "{http://www.w3.org/2000/svg}"
    corners = np.array([pair.split(",") for pair in str(tree.find(f"{space}polygon").get("points")).split()], float)
    radius = float(str(tree.find(f"{space}circle").get("r")))
    assert radius / np.ptp(corners[:, 0]) == pytest.approx(0.00475 / 0.09, rel=0.01)
    assert np.argmin(corners[:, 1]) in (0, 3) and corners[0, 0] < corners[2, 0]  # y points up, x to the right
    below = [float(str(text.get("y"))) for text in tree.iter(f"{space}text")][-3:]
    assert np.all(np.diff([corners[:, 1].max(), *below]) > 0.0)  # the legend, line by line
    assert "a <b>: 90.0 mm along x" in "".join(tree.itertext())


# --- estimated from a recording --------------------------------------------------------------------------------------


def test_a_recording_corrects_a_rig_file_or_its_own_rig(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made(tmp_path, "--circle", "0.107")
    wrong = (tmp_path / "rig.yaml").rename(tmp_path / "wrong.yaml")
    out = tmp_path / "out.yaml"
    capsys.readouterr()
    assert main(["rig", "--from", ROUND_BAG, "--rig", str(wrong), "--out", str(out), "--json", "-"]) == 0
    content = json.loads(capsys.readouterr().out)
    (finding,) = content["findings"]
    assert finding["name"] == "outline_size"
    assert finding["values"]["scale"]["value"] == pytest.approx(105 / 107, abs=0.002)
    corrected = load_rig(out)
    assert corrected.outline.semi_axes == pytest.approx((0.0525, 0.0525), abs=1e-4)
    assert (corrected.shape, corrected.surface, corrected.object_mass) == ("circle", "plywood", 0.8)
    assert main(["check", ROUND_BAG, "--rig", str(out), "--strict"]) == 0
    assert main(["rig", "--from", ROUND_BAG, "--out", str(out), "--force"]) == 0
    assert (load_rig(out).shape, load_rig(out).outline.semi_axes) == ("ellip1", (0.0525, 0.0525))
