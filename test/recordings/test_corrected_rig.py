# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A wrong outline or tip radius is found on the recordings in bags/, and the corrected rig gives no finding."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from checked_bags import finding_of
from checked_bags import sample as bag
from mistakes import mirrored, stream_part

from push_predictor.errors import RigError
from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import mirror_image, transformed
from push_predictor.recordings.checks.check import check_recording
from push_predictor.recordings.checks.corrected_rig import corrected_rig
from push_predictor.recordings.checks.finding import Finding, Severity, Value
from push_predictor.recordings.checks.outline_findings import half_size
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.simulation.pushes import random_pushes
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.slider import Slider
from push_predictor.simulation.spec import SimulationSpec

ROUND = "circle_pu"
ONE_SIDE = "square_abs_repeats"  # which cannot separate a wrong size from a shift
CORNERS = np.array([[-0.05, -0.03], [0.07, -0.03], [-0.02, 0.06]])  # of a slider without mirror symmetry


@cache
def scalene() -> Recording:
    """Pushes of a triangle whose sides differ."""
    slider = Slider("scalene", Outline(CORNERS - CORNERS.mean(axis=0)), 0.8)
    plan = random_pushes(12, (0.02,), 0.02, np.random.default_rng(1))
    return simulate(SimulationSpec(slider, "abs", plan, seed=1))


def wrong(rig: Rig, yaw: float = 0.0, shift: tuple[float, float] = (0.0, 0.0), more: float = 0.0) -> Rig:
    """The rig with its outline turned, shifted, and larger by `more` m a side."""
    return replace(rig, outline=transformed(rig.outline, yaw, shift, 1.0 + more / half_size(rig)))


def found(recording: Recording, rig: Rig) -> dict[str, Mapping[str, Value]]:
    return {finding.name: finding.values for finding in check_recording(recording, rig)}


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


def test_a_mirrored_outline_is_found_and_corrected() -> None:
    rig = require_rig(scalene())
    assert found(scalene(), rig) == {}
    altered = replace(rig, outline=mirror_image(rig.outline))
    findings = check_recording(scalene(), altered)
    assert [finding.name for finding in findings] == ["outline_mirrored"]
    corrected = corrected_rig(altered, findings)
    np.testing.assert_allclose(corrected.outline.vertices, rig.outline.vertices, atol=1e-12)
    assert corrected.support_points is not None and altered.support_points is not None
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


def test_an_outline_mirrored_and_turned_is_corrected() -> None:
    rig = require_rig(scalene())
    altered = replace(rig, outline=transformed(mirror_image(rig.outline), 0.2, (0.002, 0.0)))
    findings = check_recording(scalene(), altered)
    assert {"outline_mirrored", "outline_turned"} <= {finding.name for finding in findings}
    np.testing.assert_allclose(corrected_rig(altered, findings).outline.vertices, rig.outline.vertices, atol=2e-4)


def test_a_mirrored_frame_of_a_slider_without_symmetry_is_no_mirrored_outline() -> None:
    assert "frame_mirrored" in found(mirrored(scalene(), -1.0, -1.0), require_rig(scalene()))


def test_a_wrong_tip_is_separated_from_a_wrong_size_on_an_ellipse() -> None:
    rig = require_rig(bag("ellipse_plywood"))
    altered = replace(rig, pusher_radius=rig.pusher_radius + 0.0015)
    findings = check_recording(bag("ellipse_plywood"), altered)
    assert [finding.name for finding in findings] == ["tip_radius"]
    corrected = corrected_rig(altered, findings)
    assert corrected.pusher_radius == pytest.approx(rig.pusher_radius, abs=1e-4)
    assert corrected.outline.area == pytest.approx(rig.outline.area)


def test_a_correction_scales_and_turns_about_the_centroid_and_moves_the_feet() -> None:
    feet = np.array([[0.03, 0.0, 0.5], [-0.03, 0.0, 0.5]])
    outline = Outline(CORNERS - CORNERS.mean(axis=0) + [0.02, 0.0])
    rig = Rig("scalene", outline, 0.005, "abs", 0.8, feet)
    turned = corrected_rig(rig, [finding_of("outline_turned", yaw=np.pi / 2.0), finding_of("outline_size", scale=1.05)])
    assert turned.outline.centroid == pytest.approx([0.02, 0.0])
    assert turned.outline.vertices[0] == pytest.approx([0.02 + 0.0315, -0.0525])
    assert turned.support_points is not None
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
