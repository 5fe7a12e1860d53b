# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The push_rig record keeps a rig exactly, also an ellipse whose axes are not those of the tracked frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from push_predictor.errors import RigError
from push_predictor.geometry.shapes import SHAPES, ellipse, shape_outline, transformed
from push_predictor.recordings.rig import Rig, load_rig, rig_from_record, save_rig


def rig_of(shape: str, yaw: float, shift: tuple[float, float]) -> Rig:
    return Rig(shape, transformed(shape_outline(shape), yaw, shift), 0.00475, "abs", 0.8)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("yaw", "shift"), [(0.0, (0.0, 0.0)), (0.5, (0.04, -0.03))])
def test_a_rig_is_read_as_it_was_written(tmp_path: Path, shape: str, yaw: float, shift: tuple[float, float]) -> None:
    rig = rig_of(shape, yaw, shift)
    save_rig(rig, tmp_path / "rig.yaml")
    read = load_rig(tmp_path / "rig.yaml")
    np.testing.assert_array_equal(read.outline.vertices, rig.outline.vertices)
    assert (read.outline.semi_axes, read.outline.pose) == (rig.outline.semi_axes, rig.outline.pose)


def test_a_rig_without_mass_is_read_as_it_was_written() -> None:
    rig = Rig("rect1", shape_outline("rect1"), 0.00475, "abs")
    assert "object_mass" not in rig.to_record()
    assert rig_from_record(rig.to_record(), "here").object_mass is None
    with pytest.raises(RigError, match="here: push_rig object_mass '-1'"):
        rig_from_record({**rig.to_record(), "object_mass": "-1"}, "here")


def test_a_centred_ellipse_has_the_record_of_earlier_versions() -> None:
    assert rig_of("ellip2", 0.0, (0.0, 0.0)).to_record()["shape_parameters"] == (
        '{"type": "ellipse", "a": 0.065445, "b": 0.0525}'
    )


def test_semi_axes_of_a_slim_ellipse_across_are_not_halved() -> None:
    rig = Rig("slim", transformed(ellipse(0.1, 0.03), np.pi / 2.0), 0.00475, "abs", 0.8)
    assert rig_from_record(rig.to_record(), "slim").outline.semi_axes == (0.1, 0.03)


def test_full_axes_are_halved_along_the_axes_of_the_ellipse() -> None:
    record = rig_of("ellip3", 1.2, (0.01, 0.0)).to_record()
    full = {"type": "ellipse", "a": 0.157, "b": 0.105, "x": 0.01, "y": 0.0, "yaw": 1.2}
    assert rig_from_record({**record, "shape_parameters": full}, "full").outline.semi_axes == (0.0785, 0.0525)


@pytest.mark.parametrize("value", ["abc", float("nan"), None])
def test_a_pose_that_is_no_number_is_refused(value: object) -> None:
    record = rig_of("ellip1", 0.0, (0.0, 0.0)).to_record()
    wrong = {"type": "circle", "radius": 0.0525, "x": value}
    with pytest.raises(RigError, match="here: push_rig shape_parameters"):
        rig_from_record({**record, "shape_parameters": wrong}, "here")
