# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An instrument for the contact gap: the same gap, measured at other times than the window's displacement.

The gap at a window's start and the window's displacement contain the same two samples of the tracker, so their noise
correlates although neither causes the other. Other windows of the same push measure the same gap with other noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.standardised import push_order
from push_predictor.types import Array

GAP = "contact_gap"
KNOWN = 0.5  # share of the windows that need other windows in their push


def with_instrument(table: PushTable) -> PushTable:
    """The table with the contact gap from other windows of the same push, or without it where there are too few.

    A window with no other one gets the mean of all. Windows tile a push, so the next one begins where this one ends: it
    shares the sample at its end and does not count.
    """
    if GAP not in table.covariates:
        return table
    gap = _of_other_windows(table)
    if np.mean(np.isfinite(gap)) < KNOWN:
        return replace(table, covariates={name: c for name, c in table.covariates.items() if name != GAP})
    return replace(table, covariates={**table.covariates, GAP: np.where(np.isfinite(gap), gap, np.nanmean(gap))})


def _of_other_windows(table: PushTable) -> Array:
    """Mean gap (n,) over a push's windows except the window itself and the next one; NaN if there are none."""
    gap, push = table.covariates[GAP], push_order(table)
    order = np.argsort(push, kind="stable")
    follows = np.append(push[order][1:] == push[order][:-1], False)
    following = np.zeros(len(gap))
    following[order] = np.where(follows, np.roll(gap[order], -1), 0.0)
    excluded = np.ones(len(gap))
    excluded[order] += follows
    count = np.bincount(push)[push] - excluded
    total = np.bincount(push, gap)[push] - gap - following
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
