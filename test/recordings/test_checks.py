# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Each usual mistake of a recording is made from bags/ and found; the bags as they are give no finding."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from checked_bags import bag, found, rig_of, sample
from lab_bags import Lab, pose_values
from mistakes import (
    MISTAKES,
    UPRIGHT,
    UPSIDE_DOWN,
    Mistake,
    force_in_slider_frame,
    force_of_another_time,
    force_of_random_direction,
    force_scaled,
    late,
    mirrored,
    on_hand,
    outline_scaled,
    spatial_rows,
    stamps_scaled,
    stream_part,
    tracked,
)

from push_predictor.geometry.frames import wrap_angle
from push_predictor.recordings.checks.check import check_recording
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.checks.force import wrench_findings
from push_predictor.recordings.checks.motion import motion_of
from push_predictor.recordings.checks.units import check_table
from push_predictor.recordings.decoder.rules import slider_stream
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.write import write_recording
from push_predictor.types import Array

SMALL = "hexagon_delrin"
ONE_SIDE = "square_abs_repeats"  # which cannot separate a wrong size from a shift
PUSHED = ("circle_pu", ONE_SIDE)  # whose forces are altered


def of_force(recording: Recording, rig: Rig) -> list[Finding]:
    return wrench_findings(motion_of(recording, rig), rig)


@pytest.mark.parametrize(
    ("name", "shift"),
    [
        (SMALL, (0.0, 0.0012)),
        (ONE_SIDE, (-0.0012, 0.0)),  # along its side no contact shows a shift
    ],
)
def test_a_shift_of_over_a_millimetre_is_found_within_four_sd(name: str, shift: tuple[float, float]) -> None:
    finding = found(tracked(sample(name), 0.0, shift), rig_of(name))["outline_shifted"]
    for estimate, true in zip((finding.values["x"], finding.values["y"]), shift, strict=True):
        assert abs(estimate.value + true) < 4.0 * estimate.sd + 1e-4
    assert finding.severity == "warning" and "mm" in finding.sentence


@pytest.mark.parametrize(("name", "degrees"), [("ellipse_plywood", 2.1), ("square_abs_test", -12.0)])
def test_a_turn_of_over_two_degrees_is_found(name: str, degrees: float) -> None:
    finding = found(tracked(sample(name), np.radians(degrees), (0.0, 0.0)), rig_of(name))["outline_turned"]
    assert finding.values["yaw"].value == pytest.approx(-np.radians(degrees), abs=0.006)


@pytest.mark.parametrize("name", ["circle_pu", SMALL])
def test_a_turn_that_the_outline_does_not_show_is_no_finding(name: str) -> None:
    order = rig_of(name).outline.rotational_symmetry
    turn = 2.0 * np.pi / order if order else 0.3
    assert not found(tracked(sample(name), turn, (0.0, 0.0)), rig_of(name))


def test_a_wrong_size_is_found() -> None:
    finding = found(bag(SMALL), outline_scaled(rig_of(SMALL), 1.03))["outline_size"]
    assert finding.values["scale"].value == pytest.approx(1 / 1.03, abs=0.003)
    half = 1e3 * float(np.linalg.norm(np.mean(rig_of(SMALL).outline.vertices[:2], axis=0)))
    stated = re.search(r", (-\d+\.\d) mm a side", finding.sentence)
    assert stated and float(stated[1]) == pytest.approx(half * 1.03 * (1 / 1.03 - 1.0), abs=0.15)


def test_a_wrong_size_or_tip_seen_from_one_side_is_a_shift_with_its_rival() -> None:
    """The contacts of one side separate neither; see test_outline_causes for the other recordings."""
    rig = rig_of(ONE_SIDE)
    for wrong in (outline_scaled(rig, 1.03), replace(rig, pusher_radius=rig.pusher_radius + 0.0011)):
        finding = found(sample(ONE_SIDE), wrong)["outline_shifted"]
        assert "Or the size is wrong" in finding.advice
    assert abs(finding.values["x"].value) == pytest.approx(0.0011, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "y", "heading", "finding"),
    [
        (ONE_SIDE, -1.0, -1.0, "frame_mirrored"),
        (ONE_SIDE, 1.0, -1.0, "heading_clockwise"),
        (SMALL, -1.0, 1.0, "y_mirrored"),
        ("circle_pu", -1.0, 1.0, "frame_mirrored"),  # its heading changes no contact
    ],
)
def test_a_heading_or_a_y_axis_of_the_wrong_sign_is_named(name: str, y: float, heading: float, finding: str) -> None:
    assert list(found(mirrored(sample(name), y, heading), rig_of(name))) == [finding]


def test_few_pushes_give_no_estimate_of_the_outline() -> None:
    """Measured recordings of one long push gave a shift of 10 mm with an sd of 0.01 mm."""
    short = stream_part(bag(SMALL).slider, 0.0, 1.0 / 3.0)
    findings = found(tracked(replace(bag(SMALL), slider=short), 0.0, (0.003, 0.0)), rig_of(SMALL))
    assert {name: each.severity for name, each in findings.items()} == {"outline_unchecked": "note"}


@pytest.mark.parametrize(("factor", "unit", "finding"), [(0.0, 1.0, "no_contact"), (1.0, 1e-6, "units_time_slider")])
def test_a_slider_that_never_moves_or_has_stamps_in_a_wrong_unit_is_refused(
    factor: float, unit: float, finding: str
) -> None:
    slider = stamps_scaled(bag(SMALL), unit).slider
    altered = replace(slider, x=factor * slider.x, y=factor * slider.y, heading=factor * slider.heading)
    refused = found(replace(bag(SMALL), slider=altered), rig_of(SMALL))[finding]
    assert refused.severity == "refused"
    assert unit == 1.0 or refused.values["rate"].value == pytest.approx(1e8, rel=0.02)


def test_a_rig_in_millimetres_is_refused() -> None:
    assert "units_rig" in found(bag(SMALL), outline_scaled(rig_of(SMALL), 1e3))


def test_pushes_at_2_mm_per_s_by_a_quiet_tracker_are_pushes() -> None:
    """What moves is judged by the tracker's noise: a real rig pushed at 2.5 mm/s, slower than any fixed threshold."""
    slider, pusher = (
        replace(of, stamp=of.stamp[0] + 10 * (of.stamp - of.stamp[0])) for of in (bag(SMALL).slider, bag(SMALL).pusher)
    )
    smooth = {name: np.convolve(getattr(slider, name), np.full(5, 0.2), "same") for name in ("x", "y", "heading")}
    slow = replace(bag(SMALL), slider=replace(slider, **smooth), pusher=pusher, wrench=None)
    assert "no_contact" not in found(slow, rig_of(SMALL))


@pytest.mark.parametrize(("name", "lag"), [("ellipse_plywood", -0.05), (ONE_SIDE, 0.05)])
def test_clocks_apart_are_found_with_lag_and_sd(name: str, lag: float) -> None:
    finding = found(late(sample(name), lag), rig_of(name))["clocks_apart"]
    estimate = finding.values["lag"]
    assert estimate.value == pytest.approx(lag, abs=0.02 if name == ONE_SIDE else 0.015)
    assert estimate.sd is not None and 0.0 < estimate.sd < 0.005
    assert f"{1e3 * abs(estimate.value):.0f} ms {'late' if lag > 0.0 else 'early'} (sd " in finding.sentence


def test_a_wrong_outline_is_judged_with_corrected_stamps() -> None:
    """Else the pushes of another moment are off it, as if its shape were wrong."""
    findings = found(late(tracked(bag("hexagon_delrin"), 0.0, (0.004, -0.003)), -0.4), rig_of("hexagon_delrin"))
    assert list(findings) == ["outline_shifted", "clocks_apart"]
    assert findings["clocks_apart"].values["lag"].value == pytest.approx(-0.4, abs=0.005)


def test_the_tilt_of_a_tracker_is_no_finding() -> None:
    recording = bag(SMALL)
    tracked_in_space = slider_stream(recording.slider.stamp, spatial_rows(recording.slider))
    assert check_recording(replace(recording, slider=tracked_in_space), rig_of(SMALL)) == ()
    assert np.median(tracked_in_space.tilt) == pytest.approx(0.003, abs=0.001)


@pytest.mark.parametrize("turn", [UPRIGHT, UPSIDE_DOWN])
def test_heading_and_tilt_are_kept_by_writing(tmp_path: Path, turn: Array) -> None:
    """So that a mistake is found in an imported or repaired recording too."""
    slider = slider_stream(bag(SMALL).slider.stamp, spatial_rows(bag(SMALL).slider, turn))
    write_recording(tmp_path / "written", replace(bag(SMALL), slider=slider))
    read = read_recording(tmp_path / "written").slider
    assert read.tilt is not None and slider.tilt is not None and np.ptp(slider.tilt) > 1e-3
    np.testing.assert_allclose(read.tilt, slider.tilt, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(wrap_angle(read.heading - slider.heading), 0.0, atol=1e-9)


def test_a_body_that_is_upside_down_is_a_warning() -> None:
    """Its heading is sound, unlike that of a quaternion with w first, but the outline is seen from below."""
    rows = spatial_rows(bag(SMALL).slider, UPSIDE_DOWN)
    recording = replace(bag(SMALL), slider=slider_stream(bag(SMALL).slider.stamp, rows))
    finding = found(recording, rig_of(SMALL))["slider_tilted"]
    assert finding.severity == "warning" and "180 degrees" in finding.sentence


def test_quaternions_of_transforms_are_checked_too(tmp_path: Path) -> None:
    """As the Vicon bridge sends them."""
    recording, lab = bag(SMALL), Lab()
    rows = spatial_rows(recording.slider)
    kind, stamps = "geometry_msgs/msg/TransformStamped", recording.slider.stamp
    rows = rows[:, [0, 1, 2, 6, 3, 4, 5]]
    lab.add(
        "/vicon",
        kind,
        stamps,
        (
            lab.header(stamp) | pose_values(row, "transform", ("translation", "rotation"))
            for stamp, row in zip(stamps.tolist(), rows, strict=True)
        ),
    )
    lab.pose("/pusher/pose", "geometry_msgs/msg/PoseStamped", recording.pusher, "pose")
    read = read_recording(lab.mcap(tmp_path / "lab", rig_of(SMALL)), topics=Topics("/vicon"))
    assert list(found(read, rig_of(SMALL))) == ["quaternion_order"]


@pytest.mark.parametrize(("name", "place"), [("circle_pu", (0.0, -0.03)), ("ellipse_plywood", (-0.08, 0.0))])
def test_a_body_on_the_robots_hand_is_refused(name: str, place: tuple[float, float]) -> None:
    """Whether the tip seems to be inside the outline, on it, or outside."""
    (finding,) = check_recording(on_hand(sample(name), place), rig_of(name))
    assert (finding.name, finding.severity) == ("another_body", "refused")
    assert "moves with the tip" in finding.sentence


@pytest.mark.parametrize(("name", "shift"), [("circle_pu", 0.02), (ONE_SIDE, 0.003)])
def test_a_shifted_world_frame_is_no_exchange_of_topics(name: str, shift: float) -> None:
    slider = sample(name).slider
    findings = found(replace(sample(name), slider=replace(slider, x=slider.x + shift)), rig_of(name))
    assert findings and {each.severity for each in findings.values()} == {"warning"}


@pytest.mark.parametrize("name", ["circle_pu", "hexagon_delrin"])  # the second hardly turns
def test_a_wrench_in_the_sliders_frame_is_named(name: str) -> None:
    findings = found(force_in_slider_frame(bag(name)), rig_of(name))
    assert list(findings) == ["wrench_frame"] and "those of the slider" in findings["wrench_frame"].sentence


@pytest.mark.parametrize("name", PUSHED)
@pytest.mark.parametrize("alter", [
    force_of_random_direction,
    lambda recording: force_of_another_time(recording, -1.0 / 3.0),
])  # fmt: skip
def test_a_force_that_has_nothing_to_do_with_the_push_is_named(name: str, alter: Mistake) -> None:
    (finding,) = of_force(alter(bag(name)), rig_of(name))
    assert (finding.name, finding.severity) == ("wrench_unrelated", "warning")


@pytest.mark.parametrize("name", PUSHED)
@pytest.mark.parametrize(
    ("factor", "unit"), [(1e-3, "kN"), (1.0 / 9.81, "kgf"), (1.0 / 4.448, "lbf"), (102.0, "gf"), (1e3, "mN")]
)
def test_a_force_in_another_unit_is_named(name: str, factor: float, unit: str) -> None:
    (finding,) = of_force(force_scaled(bag(name), factor), rig_of(name))
    assert finding.name == "wrench_units" and f"if they are in {unit}" in finding.advice


def test_a_slider_of_unknown_mass_may_be_light_or_heavy() -> None:
    anything = replace(rig_of(SMALL), object_mass=None)
    assert all(of_force(force_scaled(bag(SMALL), factor), anything) == [] for factor in (0.1, 30.0))


def test_the_force_of_a_light_slider_is_judged_by_its_weight() -> None:
    """The forces that a slider of 98 g with this friction gives, of 0.12 N in the median."""
    light = replace(rig_of(SMALL), object_mass=rig_of(SMALL).object_mass / 10.0)
    assert of_force(force_scaled(bag(SMALL), 0.1), light) == []
    assert of_force(force_scaled(bag(SMALL), 0.1), rig_of(SMALL)) != []


def test_without_friction_any_force_below_three_weights_is_plausible() -> None:
    unknown = replace(rig_of(SMALL), surface_friction=None)
    assert of_force(force_scaled(bag(SMALL), 20.0), unknown) == []
    assert [each.name for each in of_force(force_scaled(bag(SMALL), 30.0), unknown)] == ["wrench_units"]
    assert [each.name for each in of_force(force_scaled(bag(SMALL), 6.0), rig_of(SMALL))] == ["wrench_units"]
    (finding,) = of_force(
        force_scaled(bag("ellipse_plywood"), 1.0 / 9.81), replace(rig_of("ellipse_plywood"), surface_friction=None)
    )
    assert "by 9.807 if they are in kgf" in finding.advice


@pytest.mark.parametrize("name", MISTAKES)
def test_each_mistake_of_the_list_is_found_alone(name: str) -> None:
    mistake, finding, severity = MISTAKES[name]
    findings = check_recording(mistake(bag(SMALL)), rig_of(SMALL))
    assert (findings[0].name, findings[0].severity) == (finding, severity)
    assert len(findings) == (2 if name == "both in mm" else 1)


@pytest.mark.parametrize(
    ("column", "factor"), [("velocity", 1e3), ("duration", 1e3), ("dtheta", 180.0 / np.pi), ("dx", 1e3)]
)
def test_wrong_units_of_a_table_are_refused_by_column(column: str, factor: float) -> None:
    n, ones = 40, np.ones((40, 3))
    inputs, outcomes, duration = ones * [0.02, 0.1, 0.0], ones * [0.003, 0.0, 0.1], np.full(n, 0.2)
    assert check_table(PushTable(inputs, duration, outcomes, np.arange(n).astype(str))) == ()
    inputs = inputs * [factor if column == "velocity" else 1.0, 1.0, 1.0]
    outcomes = outcomes * [factor if column == "dx" else 1.0, 1.0, factor if column == "dtheta" else 1.0]
    duration = duration * (factor if column == "duration" else 1.0)
    findings = check_table(PushTable(inputs, duration, outcomes, np.arange(n).astype(str)))
    assert [(finding.name, finding.severity) for finding in findings] == [(f"units_{column}", "refused")]
