# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How long a stream may be without a sample until that counts as a dropout; read and live streams alike."""

NANOSECOND = 1e-9  # s
SHORTEST_DROPOUT = 0.020  # s
DROPOUT_PERIODS = 4.0  # usual intervals between two samples


def longest_interval(period: float) -> float:
    """The longest interval (s) without a dropout in a stream with this usual interval (s)."""
    return max(SHORTEST_DROPOUT, DROPOUT_PERIODS * period)
