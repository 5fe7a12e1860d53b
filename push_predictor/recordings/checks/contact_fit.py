# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How well the contacts of a recording lie on the rig's outline, and how much of their time became windows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import to_body
from push_predictor.recordings.checks.coverage import sides_of
from push_predictor.recordings.checks.motion import Motion, motion_of
from push_predictor.recordings.dropouts import longest_interval
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable

OFF = 0.001  # m from the outline


@dataclass(frozen=True)
class ContactFit:
    """The contacts of a recording against the outline of its rig, as given.

    samples: in contact, judged by motion alone. inside, off: shares of them with the tip over OFF inside the outline,
    or away from it. side: "side" or "quarter"; gaps: median gap (m, negative inside) on each, counter-clockwise from
    the first vertex, None without a contact. contact_time, window_time: s in contact, and in windows; the latter None
    where no windows were searched for.
    """

    samples: int
    inside: float
    off: float
    side: str
    gaps: tuple[float | None, ...]
    contact_time: float
    window_time: float | None

    @property
    def lost(self) -> float | None:
        """Share of the time in contact that is in no window, None where no windows were searched for."""
        if self.window_time is None:
            return None
        return max(0.0, 1.0 - self.window_time / self.contact_time)

    def record(self) -> dict[str, object]:
        """The entry in the JSON."""
        return {
            "samples": self.samples,
            "inside_share": self.inside,
            "off_share": self.off,
            "gap_by_side": list(self.gaps),
            "contact_time": self.contact_time,
            "window_time": self.window_time,
            "lost_share": self.lost,
        }


def contact_fit(recording: Recording, rig: Rig, table: PushTable | None = None) -> ContactFit | None:
    """The fit of a recording's contacts, None without one. table: of its windows, tiled end to end."""
    motion = motion_of(recording, rig)
    if motion is None or not motion.contact.any():
        return None
    touch = motion.contact
    nearest = rig.outline.project(to_body(motion.tip, motion.slider)[touch])
    gap, (index, count, side) = nearest.distance - rig.pusher_radius, sides_of(rig.outline, nearest.contact)
    gaps = [float(np.median(gap[index == k])) if np.any(index == k) else None for k in range(count)]
    return ContactFit(
        samples=int(np.sum(touch)),
        inside=float(np.mean(gap < -OFF)),
        off=float(np.mean(gap > OFF)),
        side=side,
        gaps=tuple(gaps),
        contact_time=_contact_time(motion),
        window_time=None if table is None else float(np.sum(table.duration)),
    )


def _contact_time(motion: Motion) -> float:
    """Time (s) from samples in contact to the next ones, without dropouts."""
    step = np.diff(motion.time)
    period = float(np.median(step))
    step = np.append(np.where(step > longest_interval(period), period, step), period)
    return float(np.sum(step[motion.contact]))
