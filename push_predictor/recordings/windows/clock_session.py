# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A session of one clock: the sensor tracks between two settings of the clock, and the windows found in them."""

from __future__ import annotations

from collections import Counter

import numpy as np

from push_predictor.recordings.dropouts import CLOCK_SET, NANOSECOND
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream
from push_predictor.recordings.windows.contact import REACH, contact_samples
from push_predictor.recordings.windows.cut import WindowCutter
from push_predictor.recordings.windows.flips import HeadingFlips
from push_predictor.recordings.windows.push_segmenter import PushSegmenter, touches_nothing
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions
from push_predictor.recordings.windows.track import Track
from push_predictor.types import Array, BoolArray, IntArray

LONGEST_LAG = 30.0  # s; the other streams proceed without a stream that lags more
HISTORY = 1.0  # s of samples kept before the last evaluated one
# ns; times are counted from a multiple of this, not from the first sample, so that they do not round differently with
# the order of arrival.
ORIGIN_STEP = 1_000_000_000_000


class ClockSession:
    """Takes samples of the sensors and finds windows, until the clock of every stream was set.

    tracks: by sensor. clocks_set: the sensors whose clock was set; they take no more samples. evaluated: stamp (ns) of
    the last evaluated slider sample.
    """

    def __init__(self, rig: Rig, options: WindowOptions) -> None:
        self.tracks = {
            "slider": Track(4, position=True, angle=3),
            "pusher": Track(3, position=True),
            "wrench": Track(2),
        }
        self.clocks_set: set[str] = set()
        self.evaluated = int(np.iinfo(np.int64).min)
        self._rig = rig
        self._flips = HeadingFlips()
        self._segmenter = PushSegmenter(options)
        self._cutter = WindowCutter(rig, options.least_speed)
        self._dropouts: Counter[str] = Counter()
        self._origin: int | None = None
        self._first: int | None = None
        self._counted_until = -np.inf  # s

    @property
    def counts(self) -> Counter[str]:
        """Number of faults by kind; faults of samples also by stream. samples, touching: of the slider, in contact."""
        found = self._dropouts + self._cutter.counts + Counter(self._segmenter.counts)
        found.update(samples=self._segmenter.samples, touching=self._segmenter.touching)
        for name, track in self.tracks.items():
            # A slider that continues elsewhere was repositioned: a reset, which the segmenter counts.
            of_stream = track.counts if name != "slider" else track.order.counts
            found.update({f"{name} {kind}": count for kind, count in of_stream.items()})
            found.update(of_stream)
            found["refused"] += track.order.counts.total()
        return found

    @property
    def stamp_jitter(self) -> dict[str, float]:
        """The jitter (s) of the stamps that are replaced by regular ones, by sensor."""
        found = {name: track.repairs.regular for name, track in self.tracks.items()}
        return {name: each.noise.jitter for name, each in found.items() if each.noise is not None and each.corrected}

    @property
    def force_touches(self) -> list[tuple[float, float]]:
        """Stamp (s) of each touch that the geometry showed, and the delay of the force there; see ForceTiming."""
        origin = (self._origin or 0) * NANOSECOND
        return [(origin + time, delay) for time, delay in self._segmenter.timing.touches]

    @property
    def newest(self) -> int:
        """The latest stamp of all tracks, ns."""
        return max(int(track.stamp[-1]) for track in self.tracks.values() if len(track))

    @property
    def needed(self) -> int:
        """Stamp (ns) from which on data are needed for further windows."""
        start = self._segmenter.start
        return self.evaluated if start is None else min(start, self.evaluated)

    def extend(self, name: str, stamp: IntArray, values: Array, final: bool = False) -> bool:
        """Add samples of a sensor; with `final` all are decided. Returns whether its clock was set in them."""
        track = self.tracks[name]
        if name == "slider":
            turned = self._flips.take(stamp, values[:, [0, 1, 3]])
            values = np.column_stack([values[:, :3], values[:, 3] - turned])
        ordered = track.order.take(stamp, values, final)
        if self._origin is None and len(ordered.stamp):
            self._origin = int(ordered.stamp[0]) // ORIGIN_STEP * ORIGIN_STEP
        track.extend(track.repairs.take(ordered, final or track.order.clock_set), self._origin or 0)
        if track.order.clock_set:
            self.clocks_set.add(name)
        return track.order.clock_set

    def find(self, final: bool) -> list[PushWindow]:
        """Evaluate the samples that all streams have passed; returns the windows completed by them."""
        until, slider = self._horizon(final), self.tracks["slider"]
        if until is None:
            return []
        if self._first is None:
            self._first = next(int(track.stamp[0]) for track in reversed(self.tracks.values()) if len(track))
        first = int(np.searchsorted(slider.stamp, self.evaluated, side="right"))
        last = int(np.searchsorted(slider.time, until, side="right"))
        if last <= first:
            return []
        wrench = self.tracks["wrench"] if len(self.tracks["wrench"]) else None
        samples = contact_samples(self._rig, slider, self.tracks["pusher"], wrench, first, last)
        found = self._cutter.cut(self.tracks, self._segmenter.take(samples), self._origin or 0, self._first)
        self.evaluated = int(slider.stamp[last - 1])
        self._count_and_forget(float(slider.time[last - 1]))
        return found

    def _horizon(self, final: bool) -> float | None:
        """The time (s) up to which all streams are known, None until their periods are known."""
        slider, pusher, _ = self.tracks.values()
        present = [track for track in self.tracks.values() if not track.empty]
        if slider not in present or pusher not in present or not all(track.period_known(final) for track in present):
            return None
        if final:
            return float(min(slider.time[-1], pusher.time[-1]))
        newest, reached = (which(track.time[-1] for track in present) for which in (max, min))
        return float(max(reached, newest - LONGEST_LAG) - REACH)

    def _count_and_forget(self, evaluated: float) -> None:
        """Count the dropouts up to a time (s), and forget the samples that no further window needs."""
        start, needed = self._segmenter.start, evaluated
        if start is not None and self._origin is not None:
            needed = min(evaluated, (start - self._origin) * NANOSECOND)
        for name, track in self.tracks.items():
            count = track.dropouts(self._counted_until, evaluated)
            self._dropouts.update({f"{name} dropouts": count, "dropouts": count})
            track.forget_before(needed - HISTORY)
        self._counted_until = evaluated


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
    samples = contact_samples(rig, track, tip, None, 0, len(track))
    free, joined = touches_nothing(samples, WindowOptions()) & ~samples.in_break, ~samples.after_break
    after = np.searchsorted(track.stamp, stamp)
    within = (after > 0) & (after < len(track)) & (np.maximum.accumulate(stamp) - stamp < CLOCK_SET)
    after = np.clip(after, 1, len(track) - 1)
    return np.asarray(within & free[after - 1] & free[after] & joined[after])
