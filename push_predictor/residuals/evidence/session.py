# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The session that new data are: where its recordings begin, and its cumulative covariates at the end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from push_predictor.models.effects.covariates import CUMULATIVE
from push_predictor.models.effects.traced_session import COUNT, DISTANCE, TIME, Mark, TracedSession, beginnings
from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array


def session_of(own: Sequence[PushTable], continued: Sequence[PushTable]) -> TracedSession:
    """The session of recordings or tables with rows, in order.

    own: with the cumulative covariates of each. continued: the same rows with those of the session.
    """
    names = [name for name in CUMULATIVE if all(name in table.covariates for table in continued)]
    now = {name: max(float(np.max(_afterwards(table, name))) for table in continued) for name in names}
    began = [beginnings(table) for table in own]
    if len(names) < len(CUMULATIVE) or not own or any(each is None for each in began):
        return TracedSession(now)
    marks = [
        Mark(int(begin[0]), *(float(later.covariates[k][0] - table.covariates[k][0]) for k in (COUNT, DISTANCE)))
        for begin, table, later in zip(began, own, continued, strict=True)
        if begin is not None
    ]
    ends = [
        int(np.max(begin + np.rint(_afterwards(table, TIME) / NANOSECOND).astype(np.int64)))
        for begin, table in zip(began, own, strict=True)
        if begin is not None
    ]
    marks.append(Mark(max(ends), now[COUNT], now[DISTANCE]))
    return TracedSession(now, marks[0].stamp, tuple(sorted(marks, key=lambda mark: mark.stamp)))


def _afterwards(table: PushTable, name: str) -> Array:
    """A cumulative covariate (n,) after each row: the values that the next push begins with."""
    added = {TIME: table.duration, COUNT: np.ones(len(table)), DISTANCE: np.hypot(*table.outcomes[:, :2].T)}
    return np.asarray(table.covariates[name] + added[name])
