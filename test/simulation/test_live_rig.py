# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated rig that is pushed window by window."""

from __future__ import annotations

import numpy as np

from examples.square import square_spec
from push_predictor.geometry.frames import to_body
from push_predictor.simulation.interactive_rig import LiveRig

ONLY = np.array([0])


def test_a_tip_that_pushes_on_is_not_placed_again():
    """Two windows are one of twice the duration: speed, noise and contact go on. A new contact has other noise."""
    rigs = [LiveRig(square_spec(3), np.array([[0.0, 0.0, 0.3]])) for _ in range(3)]
    for rig, durations in zip(rigs, ([0.2, 0.2], [0.4], [0.4]), strict=True):
        rig.place(ONLY, np.array([0.1]))
        if rig is rigs[2]:
            rig.place(ONLY, np.array([0.1]))
        for duration in durations:
            rig.push(ONLY, np.array([0.02]), np.array([0.3]), duration)
    np.testing.assert_allclose(rigs[0].sliders, rigs[1].sliders, atol=1e-9)
    np.testing.assert_allclose(rigs[0].tips, rigs[1].tips, atol=1e-9)
    assert np.abs(rigs[2].sliders - rigs[1].sliders).max() > 1e-5


def test_a_slider_slides_on_until_it_rests_and_only_then_the_tip_is_placed_elsewhere():
    rig = LiveRig(square_spec(3), np.zeros((1, 3)))
    rig.place(ONLY, np.array([0.125]))
    rig.push(ONLY, np.array([0.05]), np.array([0.0]), 0.1)
    pushed, tip = rig.sliders.copy(), rig.tips.copy()
    rig.place(ONLY, np.array([0.375]))
    slid, beside = rig.sliders - pushed, to_body(rig.tips, rig.sliders)
    assert 1e-4 < slid[0, 0] < 1e-3 and np.array_equal(rig.stop(ONLY) - pushed, slid)
    np.testing.assert_allclose(tip, [[-0.045 - 0.00475 + 0.005, 0.0]], atol=1e-12)
    np.testing.assert_allclose(beside, [[0.0, -0.045 - 0.00475]], atol=1e-12)


def test_a_slow_slider_beside_it_does_not_coarsen_the_motion_of_a_fast_one():
    both, alone = (LiveRig(square_spec(3), np.zeros((2, 3))) for _ in range(2))
    for rig, who in ((both, np.arange(2)), (alone, ONLY)):
        rig.place(who, np.full(len(who), 0.1))
        rig.push(who, np.array([0.1, 0.002])[: len(who)], np.full(len(who), 0.3), 0.1)
    np.testing.assert_allclose(both.sliders[0], alone.sliders[0], atol=1e-12)
