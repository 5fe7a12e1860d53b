# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

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

from push_predictor.recordings.dropouts import CLOCK_SET
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, Stream, WrenchStream, repeated, taken
from push_predictor.recordings.windows.clock_session import LONGEST_LAG, ClockSession
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions
from push_predictor.recordings.windows.stream_faults import FAULTS
from push_predictor.types import Array, IntArray

LONGEST_GAP = 5_000_000_000  # ns; in a longer gap between samples a scalar keeps the earlier value


def find_windows(recording: Recording, rig: Rig, options: WindowOptions | None = None) -> list[PushWindow]:
    """All windows of a recording, in order of time."""
    return WindowFinder(rig, options).find(recording)


class WindowFinder:
    """Takes samples of the streams in any portions and returns windows as they become ready.

    counts: faults by kind, see stream_faults.FAULTS; faults of samples also by stream, as "slider late".
    """

    def __init__(self, rig: Rig, options: WindowOptions | None = None) -> None:
        self.rig, self.options = rig, options or WindowOptions()
        self._counts: Counter[str] = Counter()  # without those of the present session
        self._earlier_touches: list[tuple[float, float]] = []
        self._session = ClockSession(rig, self.options)
        self._postponed: list[tuple[str, IntArray, Array]] = []  # samples with the time of a clock that was set
        self._scalars: dict[str, ScalarTrack] = {}  # by topic
        self._waiting: list[PushWindow] = []  # windows that wait for their scalars

    @property
    def counts(self) -> dict[str, int]:
        """Number of faults by kind so far."""
        found = self._counts + self._session.counts
        found["refused"] += sum(track.discarded for track in self._scalars.values())
        return {kind: found[kind] for kind in FAULTS} | {k: n for k, n in sorted(found.items()) if " " in k}

    @property
    def stamp_jitter(self) -> dict[str, float]:
        """The jitter (s) of the stamps that are replaced by regular ones at present, by sensor."""
        return self._session.stamp_jitter

    @property
    def contact_share(self) -> float | None:
        """Share of the slider's samples so far in which the tip touches it, None before the first."""
        found = self._counts + self._session.counts
        return found["touching"] / found["samples"] if found["samples"] else None

    @property
    def force_touches(self) -> list[tuple[float, float]]:
        """Stamp (s) of each touch so far, and how late the force rises there, s; NaN where it does not show it."""
        return self._earlier_touches + self._session.force_touches

    def find(self, recording: Recording) -> list[PushWindow]:
        """All windows of a recording; see find_windows.

        A sample that it has twice, as in a loop, counts once.
        """
        for name, stream in recording.scalars.items():
            self.add_scalar(name, stream)
        if recording.wrench is not None:
            self.add_wrench(self._once("wrench", recording.wrench))
        self.add_pusher(self._once("pusher", recording.pusher))
        self.add_slider(self._once("slider", recording.slider))
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
        self._scalars.setdefault(name, ScalarTrack()).add(stream)

    def take_ready(self) -> list[PushWindow]:
        """The windows that have become complete since the last call."""
        found = list[PushWindow]()
        while self._session.clocks_set and self._all_clocks_are_set():
            found += self._end_session()
            self._add_postponed()
        return found + self._found(final=False)

    def finish(self) -> list[PushWindow]:
        """The remaining windows, when no more samples will come.

        Afterwards the finder starts from the beginning.
        """
        found = self._end_session()
        while self._postponed:
            self._add_postponed()
            found += self._end_session()
        self._counts["refused"] += sum(track.discarded for track in self._scalars.values())
        self._scalars = {}
        return found

    def _once(self, name: str, stream: Stream) -> Stream:
        """The samples without those that are there before, as in a loop that was recorded; they are counted."""
        again = repeated(stream)
        if count := int(np.sum(again)):
            self._counts.update({"repeated": count, f"{name} repeated": count, "refused": count})
        return taken(stream, ~again)

    # --- arriving samples ---------------------------------------------------------------------------------------

    def _add_finite(self, name: str, stamp: IntArray, values: Array) -> None:
        finite = np.isfinite(values).all(axis=1)
        if bad := int(np.sum(~finite)):
            self._counts.update({"not_finite": bad, f"{name} not_finite": bad, "refused": bad})
        self._add(name, stamp[finite], values[finite])

    def _add(self, name: str, stamp: IntArray, values: Array) -> None:
        if not len(stamp):
            return
        if name in self._session.clocks_set:
            self._postponed.append((name, stamp, values))
        else:
            self._extend(name, stamp, values)

    def _extend(self, name: str, stamp: IntArray, values: Array, final: bool = False) -> None:
        another_was_set = bool(self._session.clocks_set)
        if self._session.extend(name, stamp, values, final):
            self._counts["clock_set_back"] += not another_was_set
            self._postponed.append((name, *self._session.tracks[name].order.waiting))

    def _all_clocks_are_set(self) -> bool:
        """Whether the clock of every stream was set, or that of one longer than LONGEST_LAG ago."""
        clocks_set = self._session.clocks_set
        if all(track.empty or name in clocks_set for name, track in self._session.tracks.items()):
            return True
        spans = [np.concatenate([stamp for n, stamp, _ in self._postponed if n == name]) for name in clocks_set]
        return any(int(span[-1]) - int(span[0]) > LONGEST_LAG * 1e9 for span in spans)

    def _end_session(self) -> list[PushWindow]:
        """Finish the windows of the time before the clock was set, or of the whole stream."""
        for name, track in self._session.tracks.items():
            if name not in self._session.clocks_set:
                self._extend(name, np.empty(0, dtype=np.int64), track.values[:0], final=True)
        found = self._found(final=True)
        self._counts += self._session.counts
        self._earlier_touches = self.force_touches
        self._session = ClockSession(self.rig, self.options)
        return found

    def _add_postponed(self) -> None:
        """Add the samples that waited for the new time."""
        postponed, self._postponed = self._postponed, []
        for name, stamp, values in postponed:
            self._add(name, stamp, values)

    # --- windows ------------------------------------------------------------------------------------------------

    def _found(self, final: bool) -> list[PushWindow]:
        """Windows as far as all streams are known, those whose scalars are known, in order; with `final` all."""
        self._waiting += self._session.find(final)
        needed = self._session.needed
        for track in self._scalars.values():
            track.forget_before(min(needed, self._waiting[0].start) if self._waiting else needed)
        waiting = self._waiting
        count = len(waiting) if final else next((k for k, w in enumerate(waiting) if self._waits(w)), len(waiting))
        self._waiting = waiting[count:]
        return [self._with_scalars(window) for window in waiting[:count]]

    def _waits(self, window: PushWindow) -> bool:
        late = self._session.newest - window.start > LONGEST_GAP
        return not late and not all(track.known_at(window.start) for track in self._scalars.values())

    def _with_scalars(self, window: PushWindow) -> PushWindow:
        values = {f"topic:{name}": track.at(window.start) for name, track in self._scalars.items()}
        known = {name: value for name, value in values.items() if value is not None}
        return replace(window, covariates={**window.covariates, **known})


# --- scalar topics: their values at the start of a window -------------------------------------------------------------


class ScalarTrack:
    """The samples of one topic, with increasing stamps.

    discarded: number of samples whose stamp did not increase.
    """

    def __init__(self) -> None:
        self._stamp: IntArray = np.empty(0, dtype=np.int64)
        self._value: Array = np.empty(0)
        self.discarded = 0

    def add(self, stream: ScalarStream) -> None:
        """Append samples; where the clock was set back, all earlier samples are removed."""
        if not len(stream):
            return
        stamp, value = np.append(self._stamp, stream.stamp), np.append(self._value, stream.value)
        back = np.flatnonzero(np.diff(stamp) < -CLOCK_SET)
        if back.size:
            stamp, value = stamp[back[-1] + 1 :], value[back[-1] + 1 :]
        newer = np.diff(np.maximum.accumulate(stamp), prepend=np.iinfo(np.int64).min // 2) > 0
        self.discarded += int(np.sum(~newer))
        self._stamp, self._value = stamp[newer], value[newer]

    def known_at(self, stamp: int) -> bool:
        """Whether there is a sample at or after a time (ns), so that the value at this time is final."""
        return bool(len(self._stamp)) and int(self._stamp[-1]) >= stamp

    def at(self, stamp: int) -> float | None:
        """The value at a time (ns), None without samples.

        It is linear between samples, and constant in gaps longer than LONGEST_GAP and beyond the ends.
        """
        if not len(self._stamp):
            return None
        after = int(np.searchsorted(self._stamp, stamp, side="right"))
        if after == 0 or after == len(self._stamp):
            return float(self._value[max(after - 1, 0)])
        begin, end = int(self._stamp[after - 1]), int(self._stamp[after])
        first, second = float(self._value[after - 1]), float(self._value[after])
        return first + (second - first) * ((stamp - begin) / (end - begin)) if end - begin <= LONGEST_GAP else first

    def forget_before(self, stamp: int) -> None:
        """Remove the samples before a time (ns), except the last of them."""
        keep = max(0, int(np.searchsorted(self._stamp, stamp, side="right")) - 1)
        self._stamp, self._value = self._stamp[keep:], self._value[keep:]
