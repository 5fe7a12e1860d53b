# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the clock of a stream was set back: a replay loops, or a simulation was restarted."""

from __future__ import annotations

from push_predictor.recordings.streams import PoseStream

CLOCK_SET = 1_000_000_000  # ns by which stamps go back where a replay loops


def set_back(before: PoseStream, after: PoseStream) -> bool:
    """Whether the clock was set back between two portions."""
    return len(before) > 0 and len(after) > 0 and int(before.stamp[-1]) - int(after.stamp[0]) > CLOCK_SET
