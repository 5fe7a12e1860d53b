# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The session that a model was traced on. Its cumulative covariates go on in later recordings.

A recording that begins after the end of the session continues it. One that begins within the session has the counts of
the recording that it lies in, and one from before keeps its own. Elapsed time follows from the stamps in all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from push_predictor.models.effects.covariates import CUMULATIVE
from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.push_window import first_touches
from push_predictor.types import Array, IntArray

TIME, COUNT, DISTANCE = CUMULATIVE
ROUNDING = 10_000_000  # ns; the ids of pushes contain stamps to a millisecond


@dataclass(frozen=True)
class Mark:
    """A moment of a session: header stamp (ns); number of pushes and distance slid (m) before it."""

    stamp: int
    pushes: float
    slid: float


@dataclass(frozen=True)
class TracedSession:
    """A session as a model remembers it.

    now: the cumulative covariates at its end, by name. origin: stamp (ns) at which its elapsed time began. marks: the
    beginnings of its recordings and its end, in order of time. Data without stamps have neither.
    """

    now: Mapping[str, float] = field(default_factory=dict)
    origin: int | None = None
    marks: tuple[Mark, ...] = ()

    def continued(self, table: PushTable) -> PushTable:
        """The rows of a recording, or of a table of one, with cumulative covariates counted from this session's origin.

        The rows have those of their own recording. A table without stamps is returned as it is.
        """
        if self.origin is None or (began := beginnings(table)) is None:
            return table
        before = self._before(began)
        added = {TIME: (began - self.origin) * NANOSECOND, COUNT: before[:, 0], DISTANCE: before[:, 1]}
        later = {name: table.covariates[name] + more for name, more in added.items() if name in table.covariates}
        return replace(table, covariates={**table.covariates, **later})

    def followed_by(self, later: TracedSession) -> TracedSession:
        """The session together with the data of a later trace, in which it goes on."""
        if self.origin is None or later.origin is None:
            return later if self.origin is None else replace(self, now={**self.now, **later.now})
        (pushes, slid), begin = self._before(np.array([later.origin]))[0].tolist(), later.origin
        added = {TIME: (begin - self.origin) * NANOSECOND, COUNT: pushes, DISTANCE: slid}
        marks = [mark for mark in self.marks if mark.stamp < begin - ROUNDING]
        marks += [Mark(mark.stamp, mark.pushes + pushes, mark.slid + slid) for mark in later.marks]
        return replace(self, now={name: value + added[name] for name, value in later.now.items()}, marks=tuple(marks))

    def _before(self, began: IntArray) -> Array:
        """Pushes and distance (n, 2) of the session before the recordings that began at these stamps (n,) ns."""
        known = np.array([(0.0, 0.0), *((mark.pushes, mark.slid) for mark in self.marks)])
        return np.asarray(known[np.searchsorted([mark.stamp for mark in self.marks], began + ROUNDING, side="right")])


def beginnings(table: PushTable) -> IntArray | None:
    """Stamps (n,) ns, to a millisecond, from which the elapsed time of each row counts; None without stamps."""
    touched, names = first_touches(table.push_id), (TIME, "time_since_contact")
    if touched is None or not all(name in table.covariates for name in names):
        return None
    elapsed, since_touch = (table.covariates[name] for name in names)
    own = (since_touch - elapsed) / NANOSECOND
    return touched + np.rint(own).astype(np.int64) if np.all(np.isfinite(own)) else None
