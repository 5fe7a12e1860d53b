# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Frames with another axis up, points away from the tip, bodies on the hand, clocks that drift or are set, noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from checked_bags import bag, found, rig_of, sample
from coarse import coarse_simulator
from lab_bags import pose_rows
from mistakes import UPSIDE_DOWN, late, on_hand, spatial_rows, stream_part
from stream_faults import held
from synthetic import RADIUS, Push, translating_push

from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.geometry.shapes import ellipse
from push_predictor.recordings.checks.check import check_recording
from push_predictor.recordings.checks.clocks import clock_stage
from push_predictor.recordings.checks.finding import Evidence
from push_predictor.recordings.checks.frames import fixed_to_tip
from push_predictor.recordings.checks.motion import motion_of
from push_predictor.recordings.decoder.rules import pusher_stream, slider_stream
from push_predictor.recordings.fields.pose_rows import composed
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.streams import PoseStream, Recording, joined, taken
from push_predictor.simulation.pushes import random_pushes
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.slider import Slider
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array

HEXAGON, MANY = "hexagon_delrin", "square_abs_repeats"
BOTH = ("slider", "pusher")


def about(axis: str, degrees: float) -> Array:
    half = 0.5 * np.radians(degrees)
    return np.array([*(np.sin(half) * np.eye(3)["xyz".index(axis)]), np.cos(half)])


def turned_world(
    recording: Recording, turn: Array, streams: tuple[str, ...] = BOTH, body: Array | None = None
) -> Recording:
    """Poses in a world turned by a quaternion; body: a turn of the slider's own frame."""
    made = {"slider": slider_stream, "pusher": pusher_stream}
    altered = {}
    for name in streams:
        stream: PoseStream = getattr(recording, name)
        own = body if body is not None and name == "slider" else np.array([0.0, 0.0, 0.0, 1.0])
        none = np.zeros((len(stream), 3))
        outer, inner = (np.hstack([none, np.tile(each, (len(stream), 1))]) for each in (turn, own))
        altered[name] = made[name](stream.stamp, composed(composed(outer, pose_rows(stream)), inner))
    return replace(recording, **altered)


# --- up --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("turn", "streams", "option"),
    [
        (about("x", -90.0), BOTH, "y"),
        (about("x", 90.0), BOTH, "-y"),
        (about("y", 90.0), BOTH, "x"),
        (about("x", -90.0), ("slider",), "slider=y"),
        (about("y", -90.0), ("slider",), "slider=-x"),
        (about("x", 90.0), ("pusher",), "pusher=-y"),
        (about("x", 180.0), BOTH, "-z"),
        (about("x", 180.0), ("slider",), "slider=-z"),
        (about("y", 180.0), ("pusher",), "pusher=-z"),
    ],
)
@pytest.mark.parametrize("name", [HEXAGON, "square_abs_test"])
def test_an_axis_other_than_z_that_is_up_is_named(
    name: str, turn: Array, streams: tuple[str, ...], option: str
) -> None:
    (finding,) = check_recording(turned_world(sample(name), turn, streams), rig_of(name))
    assert (finding.name, finding.severity) == ("world_up", "refused")
    assert f"`--up={option}`" in finding.advice


@pytest.mark.long
def test_a_slider_that_a_hand_lifts_at_times_shows_the_plane_of_the_pushes() -> None:
    slider = bag(HEXAGON).slider
    time = 1e-9 * (slider.stamp - slider.stamp[0])
    lift = np.where(time % 10.0 < 2.0, 0.02 * (1.0 - np.cos(np.pi * time)), 0.0)
    recording = replace(bag(HEXAGON), slider=replace(slider, x=slider.x + 0.5 * lift, z=slider.z + lift))
    assert not {"world_up", "world_tilted"} & set(found(recording, rig_of(HEXAGON)))


def test_a_slider_that_is_carried_back_for_longer_than_it_is_pushed_shows_no_world_upside_down() -> None:
    """While the tip is lifted it moves about, and a hand carries the slider."""
    recording, time = bag(HEXAGON), np.arange(0.0, 60.0, 0.01)
    carried, angle = recording.slider, 2.0 * np.pi * time
    end, stamp = int(carried.stamp[-1]), np.rint(1e9 * (time + 1.0)).astype(np.int64)
    x, y = 0.05 * np.cos(0.2 * angle) + 0.02 * np.cos(0.9 * angle), 0.05 * np.sin(0.2 * angle)
    tip = PoseStream(end + stamp, 0.05 * np.sin(0.3 * angle), 0.05 * np.cos(0.13 * angle), 0.0 * x + 0.06, 0.0 * x)
    slider = PoseStream(end + stamp, x, y, 0.0 * x + float(carried.z[-1]), 0.0 * x)
    longer = replace(recording, slider=joined([carried, slider]), pusher=joined([recording.pusher, tip]))
    assert not {"world_up", "world_tilted"} & set(found(longer, rig_of(HEXAGON)))


def test_a_body_frame_upside_down_is_no_world_upside_down() -> None:
    upside_down = slider_stream(bag(HEXAGON).slider.stamp, spatial_rows(bag(HEXAGON).slider, UPSIDE_DOWN))
    findings = found(replace(bag(HEXAGON), slider=upside_down), rig_of(HEXAGON))
    assert list(findings) == ["slider_tilted"] and "points down" in findings["slider_tilted"].sentence


def test_a_body_and_a_world_upside_down_are_named() -> None:
    """The tilt of the body is 0 then: the tip, lifted towards negative z, shows it."""
    (finding,) = check_recording(turned_world(bag(HEXAGON), about("x", 180.0), body=UPSIDE_DOWN), rig_of(HEXAGON))
    assert finding.name == "world_up" and "`--up=-z`" in finding.advice


def test_a_body_whose_x_axis_is_up_has_no_heading() -> None:
    lying = turned_world(bag(HEXAGON), about("x", 0.0), ("slider",), about("y", 90.0))
    (finding,) = check_recording(lying, rig_of(HEXAGON))
    assert (finding.name, finding.severity) == ("slider_tilted", "refused")


@pytest.mark.parametrize(("degrees", "severity"), [(3.0, None), (14.0, "warning"), (50.0, "refused")])
def test_a_tilted_world_is_named_if_it_shortens_the_slider(degrees: float, severity: str | None) -> None:
    findings = found(turned_world(bag(HEXAGON), about("y", degrees)), rig_of(HEXAGON))
    assert {name: each.severity for name, each in findings.items()} == ({"world_tilted": severity} if severity else {})
    if severity:
        assert findings["world_tilted"].values["slider_tilt"].value == pytest.approx(np.radians(degrees), abs=0.02)


# --- the tip ---------------------------------------------------------------------------------------------------------


def with_tracked_point(recording: Recording, place: tuple[float, float, float], turns: bool = False) -> Recording:
    """The pose of a point of the tool in place of the tip's; turns: the tool turns during the recording."""
    pusher = recording.pusher
    heading = np.linspace(0.0, 9.0, len(pusher)) if turns else np.zeros(len(pusher))
    x, y = rotate(np.tile(place[:2], (len(pusher), 1)), heading).T
    moved = replace(pusher, x=pusher.x + x, y=pusher.y + y, z=pusher.z + place[2], heading=wrap_angle(heading))
    return replace(recording, pusher=moved)


def test_a_flange_above_the_tip_is_named_with_its_height() -> None:
    (finding,) = check_recording(with_tracked_point(bag(HEXAGON), (0.0, 0.0, 0.12)), rig_of(HEXAGON))
    assert (finding.name, finding.severity) == ("tip_height", "refused")
    assert finding.values["height"].value == pytest.approx(0.12, abs=0.012) and "not of the flange" in finding.advice


@pytest.mark.long
def test_a_point_above_and_away_from_the_tip_is_named_with_both() -> None:
    findings = found(with_tracked_point(bag(HEXAGON), (0.06, 0.0, 0.12)), rig_of(HEXAGON))
    assert list(findings) == ["tip_height", "frames_apart"]
    assert findings["frames_apart"].values["frame_x"].value == pytest.approx(-0.06, abs=2e-4)
    assert "not of the flange" in findings["frames_apart"].advice


@pytest.mark.long
@pytest.mark.parametrize("place", [(0.004, -0.002, 0.0), (0.05, 0.02, 0.0)])
def test_the_tips_place_along_the_axes_of_a_tool_that_turns_is_found(place: tuple[float, float, float]) -> None:
    (finding,) = check_recording(with_tracked_point(bag(HEXAGON), place, turns=True), rig_of(HEXAGON))
    assert (finding.name, finding.severity) == ("tip_offset", "warning")
    assert [finding.values[axis].value for axis in "xy"] == pytest.approx([-place[0], -place[1]], abs=2e-4)


@pytest.mark.parametrize("scale", [1.03, 0.96])
def test_a_tracker_of_another_scale_is_no_wrong_shape(scale: float) -> None:
    slider = bag(HEXAGON).slider
    scaled = replace(bag(HEXAGON), slider=replace(slider, x=scale * slider.x, y=scale * slider.y))
    (finding,) = check_recording(scaled, rig_of(HEXAGON))
    assert finding.name == "frames_apart"
    assert finding.values["frame_scale"].value == pytest.approx(scale, abs=1e-3)


# --- clocks ----------------------------------------------------------------------------------------------------------


def stepped(recording: Recording, name: str, sizes: dict[float, float]) -> Recording:
    """A stream whose clock is set by sizes (s) at shares of the recording: {share: size}."""
    stream: PoseStream = getattr(recording, name)
    stamp = stream.stamp.copy()
    for share, size in sizes.items():
        stamp[round(share * len(stamp)) :] += round(1e9 * size)
    return replace(recording, **{name: replace(stream, stamp=stamp)})


@pytest.mark.parametrize(("name", "size"), [("slider", 0.4), ("pusher", -0.4), ("pusher", 0.06), ("slider", 37.0)])
def test_a_clock_that_was_set_is_named_with_size_and_time(name: str, size: float) -> None:
    recording = bag(MANY)
    (finding,) = check_recording(stepped(recording, name, {0.4: size}), rig_of(MANY))
    assert (finding.name, finding.severity) == ("clock_step", "refused" if abs(size) > 0.1 else "warning")
    relative = size if name == "slider" else -size
    assert finding.values["step"].value == pytest.approx(relative, abs=0.005)
    stamp = getattr(recording, name).stamp
    when = 1e-9 * float(stamp[round(0.4 * len(stamp))] - recording.slider.stamp[0])
    assert finding.values["time"].value == pytest.approx(when, abs=0.1)
    assert f"the {name}'s {'forward' if size > 0.0 else 'back'}" in finding.sentence


@pytest.mark.parametrize(("size", "way"), [(0.2, "later"), (-0.2, "earlier")])
def test_a_clock_that_was_set_bit_by_bit_is_named_without_its_stream(size: float, way: str) -> None:
    slider = bag(MANY).slider
    share = np.clip((np.arange(len(slider)) - 0.4 * len(slider)) / 50.0, 0.0, 1.0)
    stamp = slider.stamp + np.round(1e9 * size * share).astype(np.int64)
    finding = found(replace(bag(MANY), slider=replace(slider, stamp=stamp)), rig_of(MANY))["clock_step"]
    assert f"the slider's stamps become {way} against the pusher's" in finding.sentence


def test_a_clock_that_was_set_back_is_corrected_from_the_right_sample_on() -> None:
    corrected = clock_stage(Evidence(stepped(bag(MANY), "slider", {0.4: -0.4}), rig_of(MANY))).recording
    np.testing.assert_allclose(corrected.slider.stamp - bag(MANY).slider.stamp, 0.0, atol=5e6)


def test_a_clock_that_was_set_back_by_seconds_is_named_too() -> None:
    assert "clock_step" in found(stepped(bag(MANY), "slider", {0.4: -5.0}), rig_of(MANY))


def test_several_steps_are_named_each() -> None:
    (finding,) = check_recording(stepped(bag(MANY), "slider", {0.3: 0.2, 0.7: -0.1}), rig_of(MANY))
    steps = [finding.values[f"step_{k}"].value for k in (1, 2)]
    assert finding.name == "clock_step" and steps == pytest.approx([0.2, -0.1], abs=0.005)


@pytest.mark.parametrize(("name", "ppm"), [("slider", 800.0), ("pusher", 800.0), ("slider", -2000.0)])
def test_a_clock_that_drifts_is_named_with_its_rate(name: str, ppm: float) -> None:
    stream: PoseStream = getattr(bag(MANY), name)
    stamp = stream.stamp + ((stream.stamp - bag(MANY).slider.stamp[0]) * 1e-6 * ppm).astype(np.int64)
    (finding,) = check_recording(replace(bag(MANY), **{name: replace(stream, stamp=stamp)}), rig_of(MANY))
    assert (finding.name, finding.severity) == ("clock_drift", "warning")
    relative = ppm if name == "slider" else -ppm
    assert 1e6 * finding.values["drift"].value == pytest.approx(relative, rel=0.05)
    assert ("fast" if relative > 0.0 else "slow") in finding.sentence


@pytest.mark.parametrize("lag", [0.06, -0.3, 5.0])
def test_a_constant_lag_is_found_however_long(lag: float) -> None:
    finding = found(late(sample("square_abs_test"), lag), rig_of("square_abs_test"))["clocks_apart"]
    assert finding.values["lag"].value == pytest.approx(lag, abs=0.003)


@pytest.mark.parametrize("name", BOTH)
@pytest.mark.parametrize("rate", [20.0, 50.0])
def test_along_a_single_side_no_outline_is_shifted(name: str, rate: float) -> None:
    """All pushes are on one side: the fit may move the outline along it, up to a corner, for nothing."""
    recording = replace(bag(MANY), **{name: held(getattr(bag(MANY), name), rate)})
    assert [*found(recording, rig_of(MANY))] == [f"repeated_poses_{name}"]


# --- noise and speed -------------------------------------------------------------------------------------------------


def noisy(recording: Recording, length: float, angle: float, rate: float) -> Recording:
    slider, rng = recording.slider, np.random.default_rng(0)
    keep = np.unique(np.searchsorted(slider.stamp, np.arange(slider.stamp[0], slider.stamp[-1], 1e9 / rate)))
    slider = taken(slider, keep)
    x, y, heading = rng.normal(size=(3, len(slider))) * np.array([[length], [length], [angle]])
    moved = replace(slider, x=slider.x + x, y=slider.y + y, heading=wrap_angle(slider.heading + heading))
    return replace(recording, slider=moved)


@pytest.mark.parametrize(("length", "degrees", "rate"), [(0.001, 0.5, 30.0), (0.0005, 0.2, 60.0), (3e-5, 0.0, 20.0)])
def test_the_noise_of_a_tracker_is_no_fault_of_outline_or_clock(length: float, degrees: float, rate: float) -> None:
    findings = found(noisy(bag("square_abs_test"), length, np.radians(degrees), rate), rig_of("square_abs_test"))
    assert not [name for name in findings if name.startswith(("outline", "clock", "tip", "frames", "wrench"))]


@pytest.mark.long
@pytest.mark.parametrize("speed", [0.15, 0.3])
def test_fast_pushes_are_no_fault_of_the_outline(speed: float) -> None:
    slider = Slider("oval", ellipse(0.05, 0.04), 0.8)
    with coarse_simulator(2.0):
        plan = random_pushes(20, (speed,), 0.03, np.random.default_rng(0))
        recording = simulate(SimulationSpec(slider, "abs", plan, seed=1))
    motion = motion_of(recording, recording.rig)
    assert np.sum(motion.touching) < np.sum(motion.contact)
    assert not [
        name for name in found(recording, recording.rig) if name.startswith(("outline_s", "clock", "tip", "frames"))
    ]


# --- a body on the robot's hand moves with the tip where a pushed slider would rest -----------------------------------


LONG = Push(end=10.5, speed=0.1)  # a metre
TOUCHING = 0.045 + RADIUS  # m from the slider's centre to the tip
AHEAD = np.array([1.0, 0.0])  # the direction of the push, against the first side of the square


def refused(recording: Recording) -> bool:
    return fixed_to_tip(motion_of(recording, require_rig(recording)), require_rig(recording)) is not None


def trimmed(recording: Recording) -> Recording:
    """From first touch to last contact."""
    begin, end = 0.6 / 11.3, 10.4 / 11.3
    slider, pusher = (stream_part(poses, begin, end) for poses in (recording.slider, recording.pusher))
    return replace(recording, slider=slider, pusher=pusher)


def test_a_slider_that_is_pushed_from_first_to_last_is_no_body_on_the_hand() -> None:
    """In its frame the tip does not move either."""
    assert not refused(translating_push(LONG)) and not refused(trimmed(translating_push(LONG)))


def test_a_body_that_never_touches_the_tip_is_refused_without_a_way_back() -> None:
    push = trimmed(translating_push(LONG))
    assert not refused(on_hand(push, tuple(TOUCHING * AHEAD)))  # nothing distinguishes it from a slider
    rig = require_rig(push)
    finding = fixed_to_tip(motion_of(on_hand(push, tuple((TOUCHING + 0.03) * AHEAD)), rig), rig)
    assert finding is not None and finding.name == "another_body" and finding.severity == "refused"
    assert finding.values["spread"].value < 1e-3


def test_a_body_that_follows_the_tip_on_its_way_back_is_refused() -> None:
    """A tip that moves away pulls nothing."""
    assert refused(on_hand(translating_push(), tuple(TOUCHING * AHEAD)))
    assert not refused(translating_push())


def test_a_body_that_the_lifted_tip_carries_is_refused() -> None:
    push = trimmed(translating_push(LONG))
    raised = replace(push.pusher, z=np.where(np.arange(len(push.pusher)) > 0.8 * len(push.pusher), 0.03, 0.0))
    assert refused(on_hand(replace(push, pusher=raised), tuple(TOUCHING * AHEAD)))


@pytest.mark.parametrize(
    ("push", "size", "judged"),
    [(LONG, 0.03, False), (LONG, 0.012, False), (LONG, 0.008, True), (Push(end=0.9), 0.004, False)],
)
def test_a_body_whose_place_at_the_tip_varies_is_not_judged(push: Push, size: float, judged: bool) -> None:
    """By more than 10 mm, or by as much as the tip travels."""
    body = on_hand(translating_push(push), (0.12, 0.0))
    swing = size * np.sin(np.linspace(0.0, 60.0, len(body.slider)))
    assert refused(replace(body, slider=replace(body.slider, x=body.slider.x + swing))) is judged
