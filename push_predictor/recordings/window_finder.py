"""Finding windows while the streams arrive.

What is found depends on header stamps alone, not on how the samples of different topics are interleaved or in what
portions they come: a slider sample is judged once all streams have passed it, from data near it in time. So a replay
watched online yields the same windows as the file read at once (`find_windows` feeds the same code in one portion).
A window gets the value that each scalar topic had at its start; it is held back until they are known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.recordings.contact_judge import REACH, judge
from push_predictor.recordings.push_tracker import PushTracker
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.scalars import APART, ScalarTrack
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, WrenchStream
from push_predictor.recordings.track import NANOSECOND, Track
from push_predictor.recordings.window_cut import Tracks, cut_window
from push_predictor.recordings.windows import PushWindow, WindowOptions
from push_predictor.types import Array, IntArray

HOLD = 30.0  # s by which a stream may lag before the others go on without it
KEPT_BEHIND = 1.0  # s of samples kept behind what was judged
# ns; times are counted from a multiple of this, not from the sample that happens to come first: they must not round
# differently with the order of arrival.
ORIGIN_STEP = 1_000_000_000_000
CLOCK_SET_BACK = 1_000_000_000  # ns; a stamp earlier than this before the last one of its stream


def find_windows(recording: Recording, rig: Rig, options: WindowOptions | None = None) -> list[PushWindow]:
    """All windows of a recording, in order of time."""
    return WindowFinder(rig, options).find(recording)


class WindowFinder:
    """Feed it streams in any portions, take the windows that are ready, finish when no more will come.

    counts: samples refused for their stamps, clocks set back, dropouts and resets that cut a push, windows left out
    because the pusher moved along or away.
    """

    def __init__(self, rig: Rig, options: WindowOptions | None = None) -> None:
        self.rig, self.options = rig, options or WindowOptions()
        self.counts = dict.fromkeys(("refused", "clock_set_back", "dropouts", "resets", "not_a_push"), 0)
        self._cut_out: list[PushWindow] = []  # without their scalars
        self._ready: list[PushWindow] = []
        self._begin()

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
        self._add("slider", stream.stamp, np.column_stack([stream.x, stream.y, stream.z, stream.heading]))

    def add_pusher(self, stream: PoseStream) -> None:
        """Samples of the pusher's tip."""
        self._add("pusher", stream.stamp, np.column_stack([stream.x, stream.y, stream.z]))

    def add_wrench(self, stream: WrenchStream) -> None:
        """Samples of the wrench on the pusher."""
        self._add("wrench", stream.stamp, np.column_stack([stream.fx, stream.fy]))

    def add_scalar(self, name: str, stream: ScalarStream) -> None:
        """Samples of a scalar topic, the covariate topic:NAME; with none of them, that some are to come.

        A window waits until every topic has passed its start, for APART of the other streams' time at most. Without a
        value by then it has no such covariate.
        """
        self._scalars.setdefault(name, ScalarTrack()).add(stream)

    def take_ready(self) -> list[PushWindow]:
        """The windows that are complete and were not taken yet."""
        self._advance(final=False)
        self._release(final=False)
        return self._taken()

    def finish(self) -> list[PushWindow]:
        """The windows not taken yet, when no more samples will come; afterwards the finder begins anew."""
        self._end()
        return self._taken()

    # --- arriving samples ---------------------------------------------------------------------------------------

    def _begin(self) -> None:
        self._tracks = {"slider": Track(4, angle=3), "pusher": Track(3), "wrench": Track(2)}
        self._scalars: dict[str, ScalarTrack] = {}
        self._tracker = PushTracker(self.options)
        self._origin: int | None = None
        self._first = 0
        self._slid = 0.0
        self._judged_stamp = np.iinfo(np.int64).min

    def _end(self) -> None:
        self._advance(final=True)
        self._release(final=True)
        self.counts["refused"] += sum(track.refused for track in self._tracks.values())
        self.counts["refused"] += sum(track.refused for track in self._scalars.values())
        for kind, count in self._tracker.counts.items():
            self.counts[kind] += count
        self._begin()

    def _taken(self) -> list[PushWindow]:
        ready, self._ready = self._ready, []
        return ready

    def _add(self, name: str, stamp: IntArray, values: Array) -> None:
        if not len(stamp):
            return
        last = self._tracks[name].stamp[-1:]
        back = np.flatnonzero(np.diff(np.concatenate([last, stamp])) < -CLOCK_SET_BACK)
        if back.size:
            cut = int(back[0]) + 1 - len(last)
            self._add(name, stamp[:cut], values[:cut])
            self.counts["clock_set_back"] += 1
            self._end()
            self._add(name, stamp[cut:], values[cut:])
            return
        if self._origin is None:
            self._first = int(stamp[0])
            self._origin = self._first // ORIGIN_STEP * ORIGIN_STEP
        self._tracks[name].extend(stamp, values, self._origin)

    # --- judging what all streams have passed -------------------------------------------------------------------

    def _advance(self, final: bool) -> None:
        until = self._horizon(final)
        slider = self._tracks["slider"]
        if until is None:
            return
        first = int(np.searchsorted(slider.stamp, self._judged_stamp, side="right"))
        last = int(np.searchsorted(slider.time, until, side="right"))
        if last <= first:
            return
        for sample in judge(self.rig, slider, self._tracks["pusher"], self._wrench(), first, last):
            for start, end in self._tracker.step(sample):
                self._cut(start, end)
        self._judged_stamp = slider.stamp[last - 1]
        self._forget(float(slider.time[last - 1]))

    def _horizon(self, final: bool) -> float | None:
        """The time (s) up to which all streams are known, None while that cannot be told."""
        slider, pusher, wrench = self._tracks.values()
        if not (len(slider) and len(pusher)):
            return None
        settled = [track.settled(final) for track in (slider, pusher, wrench) if len(track)]
        if not all(settled):
            return None
        if final:
            return float(min(slider.time[-1], pusher.time[-1]))
        newest = max(track.time[-1] for track in (slider, pusher, wrench) if len(track))
        reached = min(track.time[-1] if len(track) else -np.inf for track in (slider, pusher, wrench))
        return float(max(reached, newest - HOLD) - REACH)

    def _wrench(self) -> Track | None:
        return self._tracks["wrench"] if len(self._tracks["wrench"]) else None

    def _cut(self, start: int, end: int) -> None:
        push = self._tracker.push
        if push is None or self._origin is None:
            return
        tracks = Tracks(self._tracks["slider"], self._tracks["pusher"], self._wrench())
        window = cut_window(self.rig, tracks, self._origin, start, end, push, self._slid)
        if window is None:
            self.counts["not_a_push"] += 1
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
