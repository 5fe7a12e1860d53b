# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Which samples of a force sensor were taken in free motion: the tip touches nothing."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream
from push_predictor.recordings.windows.clock_session import ClockSession
from push_predictor.recordings.windows.contact import contact_samples
from push_predictor.recordings.windows.push_segmenter import touches_nothing
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.recordings.windows.stamp_order import ISOLATION
from push_predictor.types import BoolArray, IntArray


def free_motion(rig: Rig, slider: PoseStream, pusher: PoseStream, stamp: IntArray) -> BoolArray:
    """Whether the tip touches nothing at the slider samples before and after each stamp (n,) in ns.

    By the rule of the window finder: the tip is lifted, or away from the outline. A stamp in a dropout of a pose, or
    after the clock was set back, is not free.
    """
    session = ClockSession(rig, WindowOptions())
    session.extend("pusher", pusher.stamp, np.column_stack([pusher.x, pusher.y, pusher.z]), final=True)
    session.extend("slider", slider.stamp, np.column_stack([slider.x, slider.y, slider.z, slider.heading]), final=True)
    track, tip = session.tracks["slider"], session.tracks["pusher"]
    if not all(len(each) and each.period_known(final=True) for each in (track, tip)):
        return np.zeros(len(stamp), dtype=np.bool_)
    samples = list(contact_samples(rig, track, tip, None, 0, len(track)))
    free = np.array([touches_nothing(sample, WindowOptions()) and not sample.in_break for sample in samples])
    joined = ~np.array([sample.after_break for sample in samples])
    after = np.searchsorted(track.stamp, stamp)
    within = (after > 0) & (after < len(track)) & (np.maximum.accumulate(stamp) - stamp < ISOLATION)
    after = np.clip(after, 1, len(track) - 1)
    return np.asarray(within & free[after - 1] & free[after] & joined[after])
