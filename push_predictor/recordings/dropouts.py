# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""When a stream has a dropout, and when its clock was set back; read and live streams alike."""

from __future__ import annotations

import numpy as np

from push_predictor.types import IntArray

NANOSECOND = 1e-9  # s
SHORTEST_DROPOUT = 0.020  # s
DROPOUT_PERIODS = 4.0  # usual intervals between two samples
CLOCK_SET = 1_000_000_000  # ns by which stamps go back where a replay loops, or a simulation is restarted


def usual_interval(stamp: IntArray) -> float:
    """The median interval (s) of stamps (n,) ns, of which repeated and earlier ones count none; 0 without any."""
    step = np.diff(stamp)
    step = step[step > 0]
    return float(np.median(step)) * NANOSECOND if len(step) else 0.0


def longest_interval(period: float) -> float:
    """The longest interval (s) without a dropout in a stream with this usual interval (s)."""
    return max(SHORTEST_DROPOUT, DROPOUT_PERIODS * period)
