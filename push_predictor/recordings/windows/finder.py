"""Find windows while the streams arrive.

The windows depend on header stamps alone, not on how topics are interleaved or samples are grouped. A slider sample is
evaluated once all streams have passed it, from data near it in time. So a live replay yields the same windows as
reading the file at once (`find_windows` passes all samples in one call to the same code). A window gets the value of
each scalar topic at its start, and waits until they are known. Where the clock is set, by a looping replay or a
restarted simulation, the samples of the new time wait until all streams have reached it; the windows of the old time
are finished first.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, WrenchStream
from push_predictor.recordings.windows.contact import REACH, contact_samples
from push_predictor.recordings.windows.cut import Interval, SensorTracks, cut_window
from push_predictor.recordings.windows.push_segmenter import PushSegmenter
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions
from push_predictor.recordings.windows.scalar_track import LONGEST_GAP, ScalarTracks
from push_predictor.recordings.windows.track import NANOSECOND, Track
from push_predictor.types import Array, IntArray

LONGEST_LAG = 30.0  # s; the other streams proceed without a stream that lags more
HISTORY = 1.0  # s of samples kept before the last evaluated one
# ns; times are counted from a multiple of this, not from the first sample, so that they do not round differently with
# the order of arrival.
ORIGIN_STEP = 1_000_000_000_000
SENSORS = ("slider", "pusher", "wrench")
STREAM_FAULTS = ("repeated", "late", "ahead", "not_finite", "jumps", "dropouts", "refused", "resets", "clock_set_back")
WINDOW_FAULTS = ("not_a_push", "inside", "left_behind", "outran")


def find_windows(recording: Recording, rig: Rig, options: WindowOptions | None = None) -> list[PushWindow]:
    """All windows of a recording, in order of time."""
    return WindowFinder(rig, options).find(recording)


class WindowFinder:
    """Takes samples of the streams in any portions and returns windows as they become ready.

    counts: faults by kind, see stream_faults.FAULTS; faults of samples also by stream, as "slider late".
    """

    def __init__(self, rig: Rig, options: WindowOptions | None = None) -> None:
        self.rig, self.options = rig, options or WindowOptions()
        self._counts: Counter[str] = Counter()  # without those of the present tracks and segmenter
        self._waiting: list[PushWindow] = []  # windows that wait for their scalars
        self._ready: list[PushWindow] = []
        self._scalars = ScalarTracks()
        self._postponed: list[tuple[str, IntArray, Array]] = []  # samples with the time of a clock that was set
        self._begin_session()

    @property
    def counts(self) -> dict[str, int]:
        """Number of faults by kind so far."""
        found = self._counts + self._session_counts()
        found["refused"] += self._scalars.discarded
        return {kind: found[kind] for kind in (*STREAM_FAULTS, *WINDOW_FAULTS)} | {
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
        """Add samples of the slider's pose."""
        self._add_finite("slider", stream.stamp, np.column_stack([stream.x, stream.y, stream.z, stream.heading]))

    def add_pusher(self, stream: PoseStream) -> None:
        """Add samples of the pusher's tip."""
        self._add_finite("pusher", stream.stamp, np.column_stack([stream.x, stream.y, stream.z]))

    def add_wrench(self, stream: WrenchStream) -> None:
        """Add samples of the wrench on the pusher."""
        self._add_finite("wrench", stream.stamp, np.column_stack([stream.fx, stream.fy]))

    def add_scalar(self, name: str, stream: ScalarStream) -> None:
        """Add samples of a scalar topic, which becomes the covariate topic:NAME.

        An empty stream announces a topic. A window waits until every topic has passed its start, for at most
        LONGEST_GAP in the time of the other streams. A topic without a value by then gives the window no covariate.
        """
        self._scalars.add(name, stream)

    def take_ready(self) -> list[PushWindow]:
        """The windows that have become complete since the last call."""
        while self._set and self._all_clocks_are_set():
            self._end_session()
            self._add_postponed()
        self._advance(final=False)
        self._release(final=False)
        return self._taken()

    def finish(self) -> list[PushWindow]:
        """The remaining windows, when no more samples will come.

        Afterwards the finder starts from the beginning.
        """
        self._end_session()
        while self._postponed:
            self._add_postponed()
            self._end_session()
        self._counts["refused"] += self._scalars.discarded
        self._scalars = ScalarTracks()
        return self._taken()

    # --- arriving samples ---------------------------------------------------------------------------------------

    def _begin_session(self) -> None:
        """Start with empty tracks, at first and whenever the clock was set."""
        self._tracks = {
            "slider": Track(4, position=True, angle=3),
            "pusher": Track(3, position=True),
            "wrench": Track(2),
        }
        self._set: set[str] = set()  # streams whose clock was set
        self._segmenter = PushSegmenter(self.options)
        self._origin: int | None = None
        self._first: int | None = None
        self._slid = 0.0
        self._counted_until = -np.inf  # s
        self._evaluated = np.iinfo(np.int64).min  # stamp (ns) of the last evaluated slider sample

    def _end_session(self) -> None:
        """Finish the windows of the time before the clock was set, or of the whole stream."""
        for name in SENSORS:
            self._extend(name, np.empty(0, dtype=np.int64), self._tracks[name].values[:0], final=True)
        self._advance(final=True)
        self._release(final=True)
        self._counts += self._session_counts()
        self._begin_session()

    def _all_clocks_are_set(self) -> bool:
        """Whether the clock of every stream was set, or that of one longer than LONGEST_LAG ago."""
        if all(track.empty or name in self._set for name, track in self._tracks.items()):
            return True
        spans = [np.concatenate([stamp for n, stamp, _ in self._postponed if n == name]) for name in self._set]
        return any(int(span[-1]) - int(span[0]) > LONGEST_LAG * 1e9 for span in spans)

    def _add_postponed(self) -> None:
        """Add the samples that waited for the new time."""
        postponed, self._postponed = self._postponed, []
        for name, stamp, values in postponed:
            self._add(name, stamp, values)

    def _session_counts(self) -> Counter[str]:
        """The counts of the present tracks and segmenter."""
        found = Counter(self._segmenter.counts)
        for name, track in self._tracks.items():
            # A slider that continues elsewhere was repositioned: a reset, which the segmenter counts.
            of_stream = track.counts if name != "slider" else track.order.counts
            found.update({f"{name} {kind}": count for kind, count in of_stream.items()})
            found.update(of_stream)
            found["refused"] += track.order.counts.total()
        return found

    def _taken(self) -> list[PushWindow]:
        ready, self._ready = self._ready, []
        return ready

    def _add_finite(self, name: str, stamp: IntArray, values: Array) -> None:
        finite = np.isfinite(values).all(axis=1)
        if bad := int(np.sum(~finite)):
            self._counts.update({"not_finite": bad, f"{name} not_finite": bad, "refused": bad})
        self._add(name, stamp[finite], values[finite])

    def _add(self, name: str, stamp: IntArray, values: Array) -> None:
        if not len(stamp):
            return
        if name in self._set:
            self._postponed.append((name, stamp, values))
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
            self._counts["clock_set_back"] += not self._set
            self._set.add(name)
            self._postponed.append((name, *track.order.waiting))

    # --- evaluating what all streams have passed ------------------------------------------------------------------

    def _advance(self, final: bool) -> None:
        until = self._horizon(final)
        slider = self._tracks["slider"]
        if until is None:
            return
        if self._first is None:
            self._first = next(int(track.stamp[0]) for track in reversed(self._tracks.values()) if len(track))
        first = int(np.searchsorted(slider.stamp, self._evaluated, side="right"))
        last = int(np.searchsorted(slider.time, until, side="right"))
        if last <= first:
            return
        for sample in contact_samples(self.rig, slider, self._tracks["pusher"], self._wrench(), first, last):
            for start, end in self._segmenter.step(sample):
                self._cut(start, end)
        self._note_dropouts(float(slider.time[last - 1]))
        self._evaluated = slider.stamp[last - 1]
        self._forget(float(slider.time[last - 1]))

    def _note_dropouts(self, until: float) -> None:
        for name, track in self._tracks.items():
            count = track.dropouts(self._counted_until, until)
            self._counts.update({f"{name} dropouts": count, "dropouts": count})
        self._counted_until = until

    def _horizon(self, final: bool) -> float | None:
        """The time (s) up to which all streams are known, None until their periods are known."""
        slider, pusher, _ = self._tracks.values()
        present = [track for track in self._tracks.values() if not track.empty]
        if slider not in present or pusher not in present or not all(track.period_known(final) for track in present):
            return None
        if final:
            return float(min(slider.time[-1], pusher.time[-1]))
        newest, reached = (which(track.time[-1] for track in present) for which in (max, min))
        return float(max(reached, newest - LONGEST_LAG) - REACH)

    def _wrench(self) -> Track | None:
        return self._tracks["wrench"] if len(self._tracks["wrench"]) else None

    def _cut(self, start: int, end: int) -> None:
        push = self._segmenter.push
        if push is None or self._origin is None or self._first is None:
            return
        tracks = SensorTracks(self._tracks["slider"], self._tracks["pusher"], self._wrench())
        window = cut_window(self.rig, tracks, Interval(start, end, self._origin), push, self._slid)
        if not isinstance(window, PushWindow):
            self._counts[window] += 1
            return
        edge = int(window.covariates["edge"])
        self._segmenter.push = replace(push, last_edge=edge, window_index=push.window_index + 1)
        # Summed over windows: summed over samples, the tracker's noise would count as distance.
        self._slid += float(np.hypot(*window.displacement[:2]))
        elapsed = (start - self._first) * NANOSECOND
        self._waiting.append(replace(window, covariates={"elapsed_time": elapsed, **window.covariates}))

    def _forget(self, evaluated: float) -> None:
        start = self._segmenter.start
        needed = evaluated
        if start is not None and self._origin is not None:
            needed = min(evaluated, (start - self._origin) * 1e-9)
        for track in self._tracks.values():
            track.forget_before(needed - HISTORY)
        first = self._waiting[0].start if self._waiting else start
        self._scalars.forget_before(self._evaluated if first is None else min(first, self._evaluated))

    # --- scalars ------------------------------------------------------------------------------------------------

    def _release(self, final: bool) -> None:
        """Complete the windows whose scalars are known, in order; with `final` all windows."""
        waiting = self._waiting
        count = len(waiting) if final else next((k for k, w in enumerate(waiting) if self._waits(w)), len(waiting))
        self._ready += [self._with_scalars(window) for window in waiting[:count]]
        self._waiting = waiting[count:]

    def _waits(self, window: PushWindow) -> bool:
        newest = max(int(track.stamp[-1]) for track in self._tracks.values() if len(track))
        late = newest - window.start > LONGEST_GAP
        return not late and not self._scalars.known_at(window.start)

    def _with_scalars(self, window: PushWindow) -> PushWindow:
        return replace(window, covariates={**window.covariates, **self._scalars.covariates_at(window.start)})
