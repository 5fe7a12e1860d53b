# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A wrench along the tip's axes becomes the wrench along the world's, whatever the portions in which it comes."""

from __future__ import annotations

import numpy as np
from turning_sensor import in_sensor_axes

from push_predictor.recordings.decoder.wrench import PosedWrench
from push_predictor.recordings.fields.pose_rows import at_tip
from push_predictor.types import Array, IntArray

MS = 10**6
TIP = np.arange(0, 1000 * MS, 10 * MS)  # 100 Hz
STAMPS = np.arange(3 * MS, 980 * MS, 4 * MS)  # 250 Hz
NO_WRENCH, NO_TIP = (np.empty(0, np.int64), np.empty((0, 6))), (np.empty(0, np.int64), np.empty((0, 7)))


def poses(stamp: IntArray) -> Array:
    """A tip that turns by 2 rad a second about the vertical."""
    half = 1e-9 * stamp
    none = np.zeros(len(stamp))
    return np.column_stack([none, none, none, none, none, np.sin(half), np.cos(half)])


def world(stamp: IntArray) -> Array:
    return np.column_stack(
        [np.cos(1e-8 * stamp), np.sin(1e-8 * stamp), *np.tile([[1.0], [0.1], [0.2], [0.3]], len(stamp))]
    )


def measured(stamp: IntArray) -> Array:
    return in_sensor_axes(world(stamp), poses(stamp))


def put(turned: PosedWrench, stamp: IntArray, values: Array, at: IntArray, tip: Array) -> tuple[IntArray, Array]:
    """Stamps and wrenches along the world's axes, about the tip, that are known with these portions."""
    found = turned.put(stamp, values, at, tip)
    assert found.sensor is not None and found.tip is not None
    return found.stamp, at_tip(found.values, found.sensor, found.tip)


def test_a_clock_that_is_set_back_begins_again() -> None:
    turned = PosedWrench()
    put(turned, STAMPS, measured(STAMPS), TIP[:-10] + 3_600_000 * MS, poses(TIP[:-10]))
    assert turned.without_pose == len(STAMPS)
    late = STAMPS + 3_600_000 * MS + 1000 * MS
    put(turned, late, measured(STAMPS), *NO_TIP)
    stamp, values = put(turned, STAMPS, measured(STAMPS), TIP, poses(TIP))
    assert np.array_equal(stamp, STAMPS) and turned.without_pose == 2 * len(STAMPS)
    np.testing.assert_allclose(values, world(stamp), atol=1e-9)


def test_wrenches_whose_clock_is_set_back_before_that_of_the_tip_wait_for_it() -> None:
    turned = PosedWrench()
    old = STAMPS + 1500 * MS
    put(turned, old, measured(STAMPS), TIP[:-10] + 1500 * MS, poses(TIP[:-10]))
    without = turned.without_pose
    waiting = int(np.sum(TIP[-11] < STAMPS))
    stamp, _ = put(turned, STAMPS[:20], measured(STAMPS[:20]), *NO_TIP)
    assert len(stamp) == 0, "the tip's poses are still those of the old time"
    stamp, values = put(turned, STAMPS[20:], measured(STAMPS[20:]), TIP, poses(TIP))
    assert np.array_equal(stamp, STAMPS) and turned.without_pose == without + waiting
    np.testing.assert_allclose(values, world(stamp), atol=1e-9)


def test_few_poses_are_kept() -> None:
    turned = PosedWrench()
    for second in range(10):
        put(turned, *NO_WRENCH, TIP + second * 1000 * MS, poses(TIP))
    assert len(put(turned, STAMPS, measured(STAMPS), *NO_TIP)[0]) == 0 and turned.without_pose == len(STAMPS)
    late = STAMPS + 9000 * MS
    assert len(put(turned, late, measured(STAMPS), *NO_TIP)[0]) == len(STAMPS)
