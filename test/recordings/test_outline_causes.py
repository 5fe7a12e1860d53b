# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What explains a gap between contacts and outline, the rig that is corrected by it, and the derivatives of the fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from checked_bags import bag as whole
from checked_bags import finding_of, found, rig_of
from checked_bags import sample as bag
from mistakes import mirrored, stream_part, tracked

from push_predictor.errors import RigError
from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import (
    ellipse,
    mirror_image,
    near_symmetry,
    rectangle,
    shape_outline,
    stretched,
    transformed,
)
from push_predictor.recordings.checks.check import check_recording
from push_predictor.recordings.checks.finding import Finding, Severity
from push_predictor.recordings.checks.geometry import corrected_rig
from push_predictor.recordings.checks.motion import motion_of
from push_predictor.recordings.checks.outline_findings import outline_findings
from push_predictor.recordings.checks.outline_fit import (
    SIMILARITY,
    SIZE,
    SMALLEST,
    WEAK,
    Problem,
    contacts_of,
    fit_outline,
    half_size,
)
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.simulation.pushes import random_pushes
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.slider import Slider
from push_predictor.simulation.spec import SimulationSpec

OVAL, ROUND, HEXAGON, SQUARE = "ellipse_plywood", "circle_pu", "hexagon_delrin", "square_abs_test"
NOWHERE = (0.0, 0.0)


def other_world(recording: Recording, yaw: float, shift: tuple[float, float]) -> Recording:
    """The pusher in a world frame in which the slider's is turned by yaw and has its origin at shift."""
    pusher = recording.pusher
    x, y = (rotate(np.column_stack([pusher.x, pusher.y]), np.array(yaw)) + shift).T
    return replace(recording, pusher=replace(pusher, x=x, y=y))


def frame_of(finding: Finding) -> tuple[float, tuple[float, float]]:
    values = finding.values
    return values["frame_yaw"].value, (values["frame_x"].value, values["frame_y"].value)


# --- world frames apart ----------------------------------------------------------------------------------------------


TURN, SHIFT, BOTH = (np.radians(3.0), NOWHERE), (0.0, (0.0012, 0.0)), (np.radians(-2.0), (0.003, -0.004))


@pytest.mark.parametrize(("name", "yaw", "shift"), [(OVAL, *TURN), ("square_abs_repeats", *SHIFT), (HEXAGON, *BOTH)])
def test_world_frames_apart_are_named_with_yaw_and_shift(name: str, yaw: float, shift: tuple[float, float]) -> None:
    apart = other_world(bag(name), yaw, shift)
    findings = found(apart, rig_of(name))
    assert list(findings) == ["frames_apart"]
    turn, move = frame_of(findings["frames_apart"])
    assert turn == pytest.approx(-yaw, abs=5e-4)
    assert move == pytest.approx(tuple(rotate(-np.array(shift), np.array(-yaw))), abs=1e-4)
    assert all(0.0 < (value.sd or 0.0) < 5e-4 for value in findings["frames_apart"].values.values())
    stated = f"turned by {np.degrees(turn):.1f} degrees"
    assert stated in findings["frames_apart"].sentence and findings["frames_apart"].severity == "warning"


def test_axes_a_quarter_turn_apart_are_world_frames_apart() -> None:
    finding = found(other_world(bag(ROUND), np.pi / 2.0, (0.3, 0.0)), rig_of(ROUND))["frames_apart"]
    turn, move = frame_of(finding)
    assert wrap_angle(np.array(turn + np.pi / 2.0)) == pytest.approx(0.0, abs=1e-3)
    assert move == pytest.approx((0.0, 0.3), abs=2e-4)


def test_a_shift_of_the_slider_is_separated_from_one_between_the_frames() -> None:
    both = other_world(tracked(bag(HEXAGON), 0.0, (0.0, 0.003)), 0.0, (0.002, 0.0))
    findings = found(both, rig_of(HEXAGON))
    assert list(findings) == ["frames_apart", "outline_shifted"]
    assert frame_of(findings["frames_apart"])[1] == pytest.approx((-0.002, 0.0), abs=1e-4)
    shift = findings["outline_shifted"].values
    assert (shift["x"].value, shift["y"].value) == pytest.approx((0.0, -0.003), abs=1e-4)


# --- axes mirrored or exchanged --------------------------------------------------------------------------------------

AXES: Mapping[str, tuple[list[list[float]], float, float]] = {  # {name: (axes, sign and offset of the heading)}
    "frame_mirrored_x": ([[-1.0, 0.0], [0.0, 1.0]], -1.0, np.pi),
    "x_mirrored": ([[-1.0, 0.0], [0.0, 1.0]], 1.0, 0.0),
    "axes_exchanged": ([[0.0, 1.0], [1.0, 0.0]], -1.0, np.pi / 2.0),
    "xy_exchanged": ([[0.0, 1.0], [1.0, 0.0]], 1.0, 0.0),
}


@pytest.mark.parametrize(
    ("name", "mistake"),
    [
        *((name, "frame_mirrored_x") for name in (ROUND, HEXAGON)),
        (ROUND, "axes_exchanged"),
        *((SQUARE, mistake) for mistake in ("x_mirrored", "xy_exchanged")),
    ],
)
def test_mirrored_or_exchanged_axes_are_named(name: str, mistake: str) -> None:
    axes, sign, offset = AXES[mistake]
    slider = bag(name).slider
    x, y = np.array(axes) @ np.array([slider.x, slider.y])
    heading = wrap_angle(sign * slider.heading + offset)
    finding = found(replace(bag(name), slider=replace(slider, x=x, y=y, heading=heading)), rig_of(name))[mistake]
    assert finding.severity == "warning" and finding.values["gap_after"].value < 2e-4
    assert ("exchanged" if "exchanged" in mistake else "x axis") in finding.sentence


# --- tip radius and size ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "more"), [(ROUND, -0.0011), (OVAL, 0.0011)])
def test_a_wrong_tip_radius_is_found_with_both_readings(name: str, more: float) -> None:
    rig = rig_of(name)
    altered = replace(rig, pusher_radius=rig.pusher_radius + more)
    (finding,) = check_recording(bag(name), altered)
    radius = finding.values["radius" if name == OVAL else "radius_if_size_is_right"]
    assert radius.value == pytest.approx(rig.pusher_radius, abs=5e-5)
    assert radius.sd is not None and 0.0 < radius.sd < 5e-5
    assert finding.name == ("tip_radius" if name == OVAL else "outline_size")
    rival = f"correct the tip radius by {-1e3 * more:.1f} mm: these contacts do not separate the two"
    assert ("These contacts" if name == OVAL else rival) in finding.advice
    assert f"{1e3 * radius.value:.2f} mm (sd" in finding.sentence
    if name == OVAL:
        assert "or, if it is right, the sizes: 128.6 x 102.7 mm" in finding.advice


def test_a_wrong_size_and_a_wrong_tip_are_corrected_together() -> None:
    rig = rig_of(OVAL)
    altered = replace(rig, pusher_radius=rig.pusher_radius + 0.0015, outline=transformed(rig.outline, size=1.03))
    findings = check_recording(bag(OVAL), altered)
    assert [finding.name for finding in findings] == ["outline_size", "tip_radius"]
    corrected = corrected_rig(altered, findings)
    assert corrected.pusher_radius == pytest.approx(rig.pusher_radius, abs=1e-4)
    assert corrected.outline.area == pytest.approx(rig.outline.area, rel=2e-3)


# --- shape -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "outline", "lengths", "words"),
    [
        (OVAL, ellipse(0.065445 + 0.0013, 0.0525), [0.13089, 0.105], "130.8 x 105.0 mm"),
        (SQUARE, rectangle(0.092, 0.09), [0.09, 0.09], "90.0 x 90.0 mm"),
    ],
)
def test_a_wrong_size_along_one_axis_is_a_wrong_shape_with_both_sizes(
    name: str, outline: Outline, lengths: list[float], words: str
) -> None:
    altered = replace(rig_of(name), outline=outline)
    (finding,) = check_recording(bag(name), altered)
    assert finding.name == "outline_shape" and words in finding.sentence
    assert [finding.values[of].value for of in ("length_x", "length_y")] == pytest.approx(lengths, abs=1.5e-4)
    with pytest.raises(RigError, match=r"no rig can be estimated \(outline_shape\): The outline's shape is"):
        corrected_rig(altered, [finding])


def with_vertex_off(name: str, vertex: int, more: float = 0.003) -> Rig:
    vertices = rig_of(name).outline.vertices.copy()
    vertices[vertex] *= 1.0 + more / np.linalg.norm(vertices[vertex])
    return replace(rig_of(name), outline=Outline(vertices))


def test_a_wrong_vertex_is_a_wrong_shape_and_no_turn() -> None:
    findings = found(bag(HEXAGON), with_vertex_off(HEXAGON, 2))
    assert "outline_shape" in findings and "outline_turned" not in findings
    finding = findings["outline_shape"]
    assert 0.0005 < abs(finding.values["residual"].value) < 0.003
    assert finding.values["share_off"].value >= 0.1 and "no turn, shift or size explains" in finding.sentence


def test_the_side_with_the_wrong_vertex_is_named() -> None:
    finding = found(whole(SQUARE), with_vertex_off(SQUARE, 0))["outline_shape"]
    assert "inside, on side 1." in finding.sentence or "inside, on side 4." in finding.sentence


def test_an_ellipse_given_as_a_circle_is_a_wrong_shape() -> None:
    finding = found(bag(OVAL), replace(rig_of(OVAL), outline=ellipse(0.058, 0.058)))["outline_shape"]
    assert "at contact 0." in finding.sentence


def disturbed(recording: Recording, seed: int) -> Recording:
    """Each four seconds another offset of the tracker (0.15 mm), and noise of each sample (0.1 mm)."""
    slider, rng = recording.slider, np.random.default_rng(seed)
    period = (slider.stamp - slider.stamp[0]) // 4_000_000_000
    offset = rng.normal(0.0, 1.5e-4, (int(period.max()) + 1, 2))[period]
    x, y = offset.T + rng.normal(0.0, 1e-4, (2, len(period)))
    return replace(recording, slider=replace(slider, x=slider.x + x, y=slider.y + y))


def test_a_tracker_with_noise_and_offsets_gives_no_finding() -> None:
    for seed in range(3):
        assert check_recording(disturbed(bag(HEXAGON), seed), rig_of(HEXAGON)) == ()


@pytest.mark.parametrize(("off", "names"), [(0.0007, []), (0.0015, ["outline_shape"])])
def test_a_single_push_needs_to_be_far_off(off: float, names: list[str]) -> None:
    contacts, rig = contacts_of(motion_of(bag(ROUND), rig_of(ROUND))), rig_of(ROUND)
    away = np.where(contacts.push == contacts.push[-1], off, 0.0) / np.linalg.norm(contacts.tips, axis=1)
    moved = replace(contacts, tips=contacts.tips * (1.0 + away[:, None]))
    assert [finding.name for finding in outline_findings(moved, rig, fit_outline(moved, rig))] == names


@pytest.mark.parametrize(
    ("finding", "message"),
    [
        (finding_of("outline_size", scale=0.867), "outline: the contacts fit 0.867 times its size"),
        (finding_of("outline_size", scale=1.101), "within 10 %: measure them"),
        (finding_of("tip_radius", radius=0.0117), "pusher_radius: the contacts fit 11.70 mm in place of 4.75 mm"),
        (finding_of("tip_radius", radius=0.002), "within 55 %: measure it again"),
        (finding_of("tip_radius", radius=float("nan")), "pusher_radius"),
    ],
)
def test_an_implausible_correction_is_refused(finding: Finding, message: str) -> None:
    with pytest.raises(RigError, match=message):
        corrected_rig(rig_of(ROUND), [finding])


def test_a_diameter_given_as_the_radius_is_corrected() -> None:
    rig = replace(rig_of(ROUND), pusher_radius=0.0095)
    assert corrected_rig(rig, [finding_of("tip_radius", radius=0.0047)]).pusher_radius == 0.0047
    assert corrected_rig(rig, [finding_of("outline_size", scale=0.9)]).outline.semi_axes == pytest.approx(
        (0.04725,) * 2
    )


# --- the geometry of the fits ----------------------------------------------------------------------------------------


def test_a_stretched_ellipse_keeps_its_direction() -> None:
    outline = stretched(transformed(ellipse(0.06, 0.05), 0.4), 0.1)
    assert outline.semi_axes == pytest.approx((0.063, 0.0475)) and outline.pose == pytest.approx((0.0, 0.0, 0.4))
    assert outline.project(outline.vertices).distance == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(stretched(rectangle(0.1, 0.06), -0.2).vertices, axis=0) == pytest.approx([0.09, 0.066])


def test_an_almost_regular_outline_has_the_symmetry_of_the_regular_one() -> None:
    assert near_symmetry(with_vertex_off(HEXAGON, 2).outline) == 6
    assert near_symmetry(rectangle(0.09, 0.095)) == 4
    assert near_symmetry(rectangle(0.09, 0.12)) == 2
    assert near_symmetry(shape_outline("ellip1")) == 0 and near_symmetry(shape_outline("ellip2")) == 2
    assert near_symmetry(Outline(np.array([[-0.05, -0.03], [0.07, -0.03], [-0.02, 0.06]]))) == 1


# --- the corrected rig ------------------------------------------------------------------------------------------------


ONE_SIDE = "square_abs_repeats"  # which cannot separate a wrong size from a shift
CORNERS = np.array([[-0.05, -0.03], [0.07, -0.03], [-0.02, 0.06]])  # of a slider without mirror symmetry


@cache
def scalene(pushes: int = 12, seed: int = 1) -> Recording:
    """Pushes of a triangle whose sides differ."""
    slider = Slider("scalene", Outline(CORNERS - CORNERS.mean(axis=0)), 0.8)
    plan = random_pushes(pushes, (0.02,), 0.02, np.random.default_rng(seed))
    return simulate(SimulationSpec(slider, "abs", plan, seed=seed))


def wrong(rig: Rig, yaw: float = 0.0, shift: tuple[float, float] = (0.0, 0.0), more: float = 0.0) -> Rig:
    """The rig with its outline turned, shifted, and larger by `more` m a side."""
    return replace(rig, outline=transformed(rig.outline, yaw, shift, 1.0 + more / half_size(rig)))


@pytest.mark.parametrize("name", [ROUND, "hexagon_delrin", ONE_SIDE])
def test_the_corrected_rig_gives_no_finding(name: str) -> None:
    rig = require_rig(bag(name))
    altered = wrong(rig, -0.1, (0.003, -0.002), 0.0 if name == ONE_SIDE else 0.002)
    corrected = corrected_rig(altered, check_recording(bag(name), altered))
    assert check_recording(bag(name), corrected) == ()
    assert (corrected.outline.semi_axes is None) == (rig.outline.semi_axes is None)
    if name != ONE_SIDE:
        assert corrected.outline.rotational_symmetry == rig.outline.rotational_symmetry
        assert corrected.outline.area == pytest.approx(rig.outline.area, rel=0.005)


@pytest.mark.parametrize("name", ["ellipse_plywood", "square_abs_test"])
def test_a_tracked_frame_off_the_centre_is_in_the_corrected_outline(name: str) -> None:
    slider = bag(name).slider
    move = rotate(np.array([0.004, -0.003]), slider.heading)
    turned = wrap_angle(slider.heading + 0.08)
    off = replace(bag(name), slider=replace(slider, x=slider.x + move[:, 0], y=slider.y + move[:, 1], heading=turned))
    corrected = corrected_rig(require_rig(off), check_recording(off, require_rig(off)))
    expected = rotate(np.array([-0.004, 0.003]), np.array(-0.08))
    assert corrected.outline.centroid == pytest.approx(expected, abs=1e-4)
    assert check_recording(off, corrected) == ()


@pytest.mark.parametrize(("yaw", "x", "names", "most"), [(0.0, 0.0, [], 1e-12), (0.2, 0.002, ["outline_turned"], 2e-4)])
def test_a_mirrored_outline_is_found_and_corrected(yaw: float, x: float, names: list[str], most: float) -> None:
    rig = require_rig(scalene())
    assert found(scalene(), rig) == {}
    altered = replace(rig, outline=transformed(mirror_image(rig.outline), yaw, (x, 0.0)))
    findings = check_recording(scalene(), altered)
    assert [finding.name for finding in findings][: 1 + len(names)] == ["outline_mirrored", *names]
    corrected = corrected_rig(altered, findings)
    np.testing.assert_allclose(corrected.outline.vertices, rig.outline.vertices, atol=most)
    if not yaw:
        assert len(findings) == 1
        np.testing.assert_allclose(corrected.support_points, altered.support_points * [1.0, -1.0, 1.0])


def test_few_pushes_show_no_mirrored_outline() -> None:
    few = replace(scalene(), slider=stream_part(scalene().slider, 0.0, 0.4), wrench=None)
    rig = require_rig(few)
    altered = replace(rig, outline=mirror_image(rig.outline))
    assert list(found(few, altered)) == ["outline_unchecked"]


def test_an_almost_square_outline_is_not_turned_by_a_quarter() -> None:
    rig = require_rig(bag("square_abs_test"))
    measured = replace(rig, outline=Outline(rig.outline.vertices * [1.0 + 2e-5, 1.0 - 2e-5]))
    assert measured.outline.rotational_symmetry == 2
    assert found(bag("square_abs_test"), measured) == {}


def test_a_mirrored_frame_of_a_slider_without_symmetry_is_no_mirrored_outline() -> None:
    assert "frame_mirrored" in found(mirrored(scalene(), -1.0, -1.0), require_rig(scalene()))
    few = scalene(8, seed=43)  # that the mirror image fits better than the outline, too, but not best
    assert list(found(mirrored(few, -1.0, 1.0), require_rig(few))) == ["y_mirrored"]


def test_a_correction_scales_and_turns_about_the_centroid_and_moves_the_feet() -> None:
    feet = np.array([[0.03, 0.0, 0.5], [-0.03, 0.0, 0.5]])
    outline = Outline(CORNERS - CORNERS.mean(axis=0) + [0.02, 0.0])
    rig = Rig("scalene", outline, 0.005, "abs", 0.8, feet)
    turned = corrected_rig(rig, [finding_of("outline_turned", yaw=np.pi / 2.0), finding_of("outline_size", scale=1.05)])
    assert turned.outline.centroid == pytest.approx([0.02, 0.0])
    assert turned.outline.vertices[0] == pytest.approx([0.02 + 0.0315, -0.0525])
    np.testing.assert_allclose(turned.support_points, [[0.02, 0.0105, 0.5], [0.02, -0.0525, 0.5]], atol=1e-12)


def test_a_shift_that_ends_near_the_origin_ends_at_the_origin() -> None:
    rig = wrong(require_rig(bag("square_abs_test")), shift=(0.003, 0.0))
    near = corrected_rig(rig, [finding_of("outline_shifted", x=-0.0031, y=0.0001)])
    assert near.outline.centroid == pytest.approx([0.0, 0.0], abs=1e-15)
    far = corrected_rig(rig, [finding_of("outline_shifted", x=-0.0035, y=0.0)])
    assert far.outline.centroid == pytest.approx([-0.0005, 0.0])


def test_without_a_finding_the_rig_is_the_same() -> None:
    rig = require_rig(bag(ROUND))
    assert corrected_rig(rig, []) is rig
    apart = [finding_of("clocks_apart", lag=0.1), finding_of("frames_apart", frame_yaw=0.1, frame_x=0.01, frame_y=0.0)]
    assert corrected_rig(rig, apart) is rig


@pytest.mark.parametrize(
    ("name", "severity"), [("topics_swapped", "refused"), ("frame_mirrored", "warning"), ("outline_misfit", "warning")]
)
def test_a_mistake_that_hides_the_outline_prevents_a_correction(name: str, severity: Severity) -> None:
    hiding = Finding(name, severity, "What was found.", "")
    with pytest.raises(RigError, match=rf"no rig can be estimated \({name}\): What was found"):
        corrected_rig(require_rig(bag(ROUND)), [finding_of("outline_shifted", x=0.1, y=0.0), hiding])


# --- the derivatives of the gaps between tip and outline --------------------------------------------------------------


CORRECTION = np.array([0.1, 0.003, -0.002, 0.05, 0.01, 0.001, 0.02, 0.004, 0.003, 0.06, 0.01, 0.002, -0.003])
STEP = 1e-6
NEAR_CORNERS = 0.02  # share of the tips whose nearest side changes within a step


def problem_of(name: str, turn: float = 0.0) -> Problem:
    rig, contacts = rig_of(name), contacts_of(motion_of(whole(name), rig_of(name)))
    return Problem(contacts, replace(rig, outline=transformed(rig.outline, turn)), SIMILARITY)


@pytest.mark.parametrize(
    ("name", "turn"), [("hexagon_delrin", 0.0), ("ellipse_plywood", 0.0), ("ellipse_plywood", 0.4)]
)
def test_slopes_are_the_derivatives_of_the_gaps(name: str, turn: float) -> None:
    problem, steps = problem_of(name, turn), STEP * np.eye(len(WEAK))
    slopes = problem.slopes(CORRECTION)
    for k, step in enumerate(steps):
        difference = (problem.gaps(CORRECTION + step) - problem.gaps(CORRECTION - step)) / (2.0 * STEP)
        assert np.quantile(np.abs(difference - slopes[:, k]), 1.0 - NEAR_CORNERS) < 1e-6


def test_a_size_that_no_slider_has_changes_nothing() -> None:
    problem, tiny, smallest = problem_of("hexagon_delrin"), np.zeros(len(WEAK)), np.zeros(len(WEAK))
    tiny[SIZE], smallest[SIZE] = SMALLEST - 0.2, SMALLEST
    assert not problem.slopes(tiny)[:, SIZE].any()
    np.testing.assert_array_equal(problem.gaps(tiny), problem.gaps(smallest))


def test_a_fit_knows_the_derivatives_of_the_prior_too() -> None:
    free = np.arange(len(WEAK)) < 5
    problem, part = problem_of("ellipse_plywood"), CORRECTION[free]
    for k, step in enumerate(STEP * np.eye(len(part))):
        difference = (problem.residuals(part + step) - problem.residuals(part - step)) / (2.0 * STEP)
        np.testing.assert_allclose(problem.jacobian(part)[:, k], difference, rtol=1e-4, atol=1e-3)
    prior = problem.jacobian(part)[-len(part) :]
    np.testing.assert_allclose(prior, np.diag(1.0 / WEAK[free]))
