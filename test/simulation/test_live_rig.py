# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated rig that is pushed window by window."""

from __future__ import annotations

import numpy as np

from examples.square import square_spec
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
