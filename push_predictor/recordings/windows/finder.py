"""Finding windows while the streams arrive.

What is found depends on header stamps alone, not on how the samples of different topics are interleaved or in what
portions they come: a slider sample is judged once all streams have passed it, from data near it in time. So a replay
watched online yields the same windows as the file read at once (`find_windows` feeds the same code in one portion).
A window gets the value that each scalar topic had at its start; it is held back until they are known.
Where the clock is set, by a replay that loops or a simulation that begins again, the streams of the new time wait until
all have arrived in it; windows of the old time are finished first.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, WrenchStream
from push_predictor.recordings.windows.contact import REACH, judge
from push_predictor.recordings.windows.cut import Tracks, cut_window
from push_predictor.recordings.windows.push_segmenter import PushTracker
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions
from push_predictor.recordings.windows.scalars import APART, ScalarTrack
from push_predictor.recordings.windows.track import NANOSECOND, Track
from push_predictor.types import Array, IntArray

HOLD = 30.0  # s by which a stream may lag before the others go on without it
KEPT_BEHIND = 1.0  # s of samples kept behind what was judged
# ns; times are counted from a multiple of this, not from the sample that happens to come first: they must not round
# differently with the order of arrival.
ORIGIN_STEP = 1_000_000_000_000
SENSORS = ("slider", "pusher", "wrench")
KINDS = ("repeated", "late", "ahead", "not_finite", "jumps", "dropouts", "refused", "resets", "clock_set_back")
LEFT_OUT = ("not_a_push", "inside", "left_behind", "outran")


def find_windows(recording: Recording, rig: Rig, options: WindowOptions | None = None) -> list[PushWindow]:
    """All windows of a recording, in order of time."""
    return WindowFinder(rig, options).find(recording)


class WindowFinder:
    """Feed it streams in any portions, take the windows that are ready, finish when no more will come.

    counts: what was met, see stream_faults.FAULTS; of the samples also by stream, as "slider late".
    """

    def __init__(self, rig: Rig, options: WindowOptions | None = None) -> None:
        self.rig, self.options = rig, options or WindowOptions()
        self._past: Counter[str] = Counter()  # counts up to the last time that a clock was set, and what has none since
        self._cut_out: list[PushWindow] = []  # without their scalars
        self._ready: list[PushWindow] = []
        self._scalars: dict[str, ScalarTrack] = {}
        self._later: list[tuple[str, IntArray, Array]] = []  # samples of the new time, where a clock was set
        self._begin()

    @property
    def counts(self) -> dict[str, int]:
        """How often each kind of fault was met until now."""
        found = self._past + self._present()
        found["refused"] += sum(track.refused for track in self._scalars.values())
        return {kind: found[kind] for kind in (*KINDS, *LEFT_OUT)} | {
            k: n for k, n in sorted(found.items()) if " " in k
        }

    def find(self, recording: Recording) -> list[PushWindow]:
        """All windows of a recording; see find_windows."""
        for name, stream in recording.scalars.items():
            self.add_scalar(name, stream)
        if recording.wrench is not None:
            self.add_wrench(recording.wrench)
        self.add_pusher(recording.pusher)
        self.add_slider(recording.slider)
        return self.finish()

    def add_slider(self, stream: PoseStream) -> None:
        """Samples of the slider's pose."""
        self._arrived("slider", stream.stamp, np.column_stack([stream.x, stream.y, stream.z, stream.heading]))

    def add_pusher(self, stream: PoseStream) -> None:
        """Samples of the pusher's tip."""
        self._arrived("pusher", stream.stamp, np.column_stack([stream.x, stream.y, stream.z]))

    def add_wrench(self, stream: WrenchStream) -> None:
        """Samples of the wrench on the pusher."""
        self._arrived("wrench", stream.stamp, np.column_stack([stream.fx, stream.fy]))

    def add_scalar(self, name: str, stream: ScalarStream) -> None:
        """Samples of a scalar topic, the covariate topic:NAME; with none of them, that some are to come.

        A window waits until every topic has passed its start, for APART of the other streams' time at most. Without a
        value by then it has no such covariate.
        """
        self._scalars.setdefault(name, ScalarTrack()).add(stream)

    def take_ready(self) -> list[PushWindow]:
        """The windows that are complete and were not taken yet."""
        while self._set and self._new_time_is_here():
            self._end()
            self._resume()
        self._advance(final=False)
        self._release(final=False)
        return self._taken()

    def finish(self) -> list[PushWindow]:
        """The windows not taken yet, when no more samples will come; afterwards the finder begins anew."""
        self._end()
        while self._later:
            self._resume()
            self._end()
        self._past["refused"] += sum(track.refused for track in self._scalars.values())
        self._scalars = {}
        return self._taken()

    # --- arriving samples ---------------------------------------------------------------------------------------

    def _begin(self) -> None:
        self._tracks = {"slider": Track(4, place=True, angle=3), "pusher": Track(3, place=True), "wrench": Track(2)}
        self._set: set[str] = set()  # streams whose clock was set
        self._tracker = PushTracker(self.options)
        self._origin: int | None = None
        self._first: int | None = None
        self._slid = 0.0
        self._counted_until = -np.inf  # s
        self._judged_stamp = np.iinfo(np.int64).min

    def _end(self) -> None:
        """Finish the windows of the time that is over."""
        for name in SENSORS:
            self._extend(name, *self._nothing(name), final=True)
        self._advance(final=True)
        self._release(final=True)
        self._past += self._present()
        self._begin()

    def _new_time_is_here(self) -> bool:
        """Has the clock of every stream been set, or that of one long ago?"""
        if all(track.empty or name in self._set for name, track in self._tracks.items()):
            return True
        spans = [np.concatenate([stamp for n, stamp, _ in self._later if n == name]) for name in self._set]
        return any(int(span[-1]) - int(span[0]) > HOLD * 1e9 for span in spans)

    def _resume(self) -> None:
        """Take the samples that waited for the new time."""
        later, self._later = self._later, []
        for name, stamp, values in later:
            self._add(name, stamp, values)

    def _present(self) -> Counter[str]:
        """The counts since the last time that a clock was set."""
        found = Counter(self._tracker.counts)
        for name, track in self._tracks.items():
            # Where the slider goes on elsewhere it was put there: a reset, which the tracker counts.
            of_stream = track.counts if name != "slider" else track.order.counts
            found.update({f"{name} {kind}": count for kind, count in of_stream.items()})
            found.update(of_stream)
            found["refused"] += track.order.counts.total()
        return found

    def _taken(self) -> list[PushWindow]:
        ready, self._ready = self._ready, []
        return ready

    def _nothing(self, name: str) -> tuple[IntArray, Array]:
        return np.empty(0, dtype=np.int64), self._tracks[name].values[:0]

    def _arrived(self, name: str, stamp: IntArray, values: Array) -> None:
        finite = np.isfinite(values).all(axis=1)
        if bad := int(np.sum(~finite)):
            self._past.update({"not_finite": bad, f"{name} not_finite": bad, "refused": bad})
        self._add(name, stamp[finite], values[finite])

    def _add(self, name: str, stamp: IntArray, values: Array) -> None:
        if not len(stamp):
            return
        if name in self._set:
            self._later.append((name, stamp, values))
            return
        self._extend(name, stamp, values)

    def _extend(self, name: str, stamp: IntArray, values: Array, final: bool = False) -> None:
        if name in self._set:
            return
        track = self._tracks[name]
        ordered = track.order.take(stamp, values, final)
        if self._origin is None and len(ordered.stamp):
            self._origin = int(ordered.stamp[0]) // ORIGIN_STEP * ORIGIN_STEP
        track.extend(ordered, self._origin or 0)
        if ordered.clock_set:
            self._past["clock_set_back"] += not self._set
            self._set.add(name)
            self._later.append((name, *track.order.waiting))

    # --- judging what all streams have passed -------------------------------------------------------------------

    def _advance(self, final: bool) -> None:
        until = self._horizon(final)
        slider = self._tracks["slider"]
        if until is None:
            return
        if self._first is None:
            self._first = next(int(track.stamp[0]) for track in reversed(self._tracks.values()) if len(track))
        first = int(np.searchsorted(slider.stamp, self._judged_stamp, side="right"))
        last = int(np.searchsorted(slider.time, until, side="right"))
        if last <= first:
            return
        for sample in judge(self.rig, slider, self._tracks["pusher"], self._wrench(), first, last):
            for start, end in self._tracker.step(sample):
                self._cut(start, end)
        self._note_dropouts(float(slider.time[last - 1]))
        self._judged_stamp = slider.stamp[last - 1]
        self._forget(float(slider.time[last - 1]))

    def _note_dropouts(self, until: float) -> None:
        for name, track in self._tracks.items():
            count = track.dropouts(self._counted_until, until)
            self._past.update({f"{name} dropouts": count, "dropouts": count})
        self._counted_until = until

    def _horizon(self, final: bool) -> float | None:
        """The time (s) up to which all streams are known, None while that cannot be told."""
        slider, pusher, _ = self._tracks.values()
        there = [track for track in self._tracks.values() if not track.empty]
        if slider not in there or pusher not in there or not all(track.settled(final) for track in there):
            return None
        if final:
            return float(min(slider.time[-1], pusher.time[-1]))
        newest, reached = (which(track.time[-1] for track in there) for which in (max, min))
        return float(max(reached, newest - HOLD) - REACH)

    def _wrench(self) -> Track | None:
        return self._tracks["wrench"] if len(self._tracks["wrench"]) else None

    def _cut(self, start: int, end: int) -> None:
        push = self._tracker.push
        if push is None or self._origin is None or self._first is None:
            return
        tracks = Tracks(self._tracks["slider"], self._tracks["pusher"], self._wrench())
        window = cut_window(self.rig, tracks, self._origin, start, end, push, self._slid)
        if not isinstance(window, PushWindow):
            self._past[window] += 1
            return
        edge = int(window.covariates["edge"])
        self._tracker.push = replace(push, last_edge=edge, window_index=push.window_index + 1)
        # From window to window: summed over samples, the tracker's noise would count as a way.
        self._slid += float(np.hypot(*window.displacement[:2]))
        elapsed = (start - self._first) * NANOSECOND
        self._cut_out.append(replace(window, covariates={"elapsed_time": elapsed, **window.covariates}))

    def _forget(self, judged: float) -> None:
        start = self._tracker.start
        needed = judged if start is None or self._origin is None else min(judged, (start - self._origin) * 1e-9)
        for track in self._tracks.values():
            track.forget_before(needed - KEPT_BEHIND)
        first = self._cut_out[0].start if self._cut_out else start
        for scalar in self._scalars.values():
            scalar.forget_before(self._judged_stamp if first is None else min(first, self._judged_stamp))

    # --- scalars ------------------------------------------------------------------------------------------------

    def _release(self, final: bool) -> None:
        """Complete the windows whose scalars are known, in order; at the end, all."""
        waiting = self._cut_out
        count = len(waiting) if final else next((k for k, w in enumerate(waiting) if self._waits(w)), len(waiting))
        self._ready += [self._with_scalars(window) for window in waiting[:count]]
        self._cut_out = waiting[count:]

    def _waits(self, window: PushWindow) -> bool:
        newest = max(int(track.stamp[-1]) for track in self._tracks.values() if len(track))
        late = newest - window.start > APART
        return not late and not all(track.passed(window.start) for track in self._scalars.values())

    def _with_scalars(self, window: PushWindow) -> PushWindow:
        values = {f"topic:{name}": track.at(window.start) for name, track in self._scalars.items()}
        known = {name: value for name, value in values.items() if value is not None}
        return replace(window, covariates={**window.covariates, **known})
