# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Angles and planar frames: rigid motions are invertible and preserve lengths."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from push_predictor.geometry.frames import quaternion_of_yaw, rotate, to_body, to_world, wrap_angle, yaw_of_quaternion

angles = st.floats(-50.0, 50.0)
points = arrays(np.float64, (5, 2), elements=st.floats(-2.0, 2.0))
poses = arrays(np.float64, (5, 3), elements=st.floats(-4.0, 4.0))


@given(angles)
def test_wrapped_angle_has_the_same_direction_within_half_a_turn(angle):
    wrapped = float(wrap_angle(np.array(angle)))
    assert -np.pi <= wrapped < np.pi
    assert [np.cos(wrapped), np.sin(wrapped)] == pytest.approx([np.cos(angle), np.sin(angle)], abs=1e-12)


def test_half_a_turn_wraps_to_minus_pi():
    assert wrap_angle(np.array([np.pi, -np.pi, 3 * np.pi])) == pytest.approx(-np.pi)


def test_rotation_is_counter_clockwise():
    assert rotate(np.array([1.0, 0.0]), np.array(np.pi / 2)) == pytest.approx([0.0, 1.0])


@given(points, angles, angles)
def test_rotations_add_up_and_keep_lengths(vectors, first, second):
    both = rotate(rotate(vectors, np.array(first)), np.array(second))
    assert both == pytest.approx(rotate(vectors, np.array(first + second)), abs=1e-10)
    assert np.linalg.norm(both, axis=1) == pytest.approx(np.linalg.norm(vectors, axis=1), abs=1e-12)


@given(points, poses)
def test_body_and_world_transforms_are_inverse(here, at):
    assert to_world(to_body(here, at), at) == pytest.approx(here, abs=1e-12)
    assert to_body(to_world(here, at), at) == pytest.approx(here, abs=1e-12)


def test_point_ahead_of_a_body_facing_left_is_to_its_left_in_the_world():
    pose = np.array([1.0, 2.0, np.pi / 2])
    assert to_world(np.array([0.5, 0.0]), pose) == pytest.approx([1.0, 2.5])
    assert to_body(np.array([1.0, 2.5]), pose) == pytest.approx([0.5, 0.0])


@given(st.floats(-3.1, 3.1))
def test_yaw_is_recovered_from_its_quaternion(yaw):
    z, w = quaternion_of_yaw(np.array(yaw))
    zero = np.zeros(())
    assert z**2 + w**2 == pytest.approx(1.0)
    assert yaw_of_quaternion(zero, zero, z, w) == pytest.approx(yaw, abs=1e-12)
    assert yaw_of_quaternion(zero, zero, -z, -w) == pytest.approx(yaw, abs=1e-12)  # the same attitude


@given(st.floats(-3.1, 3.1), st.floats(-0.3, 0.3))
def test_roll_about_the_heading_does_not_change_the_yaw(yaw, roll):
    z, w = quaternion_of_yaw(np.array(yaw))
    cos, sin = np.cos(roll / 2), np.sin(roll / 2)
    assert yaw_of_quaternion(w * sin, z * sin, z * cos, w * cos) == pytest.approx(yaw, abs=1e-12)
