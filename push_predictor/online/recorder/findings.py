# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What is found in messages while they are recorded: samples, their pace, windows, contact."""

from __future__ import annotations

from collections import deque

import numpy as np

from push_predictor.online.recorder.live_streams import LiveStreams
from push_predictor.online.recorder.pace import Pace
from push_predictor.online.recorder.progress import StreamFigures
from push_predictor.online.recorder.recorded_topics import COVARIATE, sources_of
from push_predictor.online.stream_sync import Samples
from push_predictor.recordings.fields.sources import Source
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.push_window import PushWindow

EARLY = 30  # portions that wait for the rig and for the first sample of slider and pusher


class Findings:
    """Takes messages as they are recorded.

    topics: with full names; now: the time (s) from which on messages are expected; windows: number of them so far.
    """

    def __init__(self, topics: Topics, now: float) -> None:
        self.windows = 0
        self._streams = LiveStreams(topics)
        self._paces = [(name, source, Pace(now)) for name, source in sources_of(topics)]
        self._log_times: dict[str, list[int]] = {}
        self._finder: WindowFinder | None = None
        self._early: deque[Samples] = deque(maxlen=EARLY)
        self._pushes: set[str] = set()

    def add_topic(self, topic: str, type_name: str, schema: str) -> None:
        """State the type of a topic; schema: its definition, '' if unknown."""
        self._streams.add_topic(topic, type_name, schema)

    def set_rig(self, rig: Rig) -> None:
        """Find windows of this rig from now on, and in the last EARLY portions."""
        self._finder = WindowFinder(rig)

    def put(self, topic: str, log_time: int, data: bytes) -> None:
        """Add a message; log_time in ns."""
        self._log_times.setdefault(topic, []).append(log_time)
        self._streams.put(topic, log_time, data)

    def work(self, now: float, last: bool = False) -> None:
        """Evaluate the portion of messages since the last call; last: no more will come."""
        samples = self._streams.take()
        stamps = {"slider": samples.slider.stamp, "pusher": samples.pusher.stamp, "wrench": samples.wrench.stamp}
        for name, source, pace in self._paces:
            logged = np.array(self._log_times.get(source.topic, []) if name == COVARIATE else [], np.int64)
            pace.add(stamps.get(name, logged), now)
        self._log_times = {}
        self._early.append(samples)
        if self._finder is not None:
            self._feed(self._finder)
            self._count(self._finder.finish() if last else self._finder.take_ready())

    @property
    def pushes(self) -> int | None:
        """Number of pushes with a window so far, None without a rig."""
        return None if self._finder is None else len(self._pushes)

    @property
    def contact(self) -> float | None:
        """Share of the slider's samples in which the tip touches it, None before the first and without a rig."""
        return None if self._finder is None else self._finder.contact_share

    @property
    def figures(self) -> tuple[StreamFigures, ...]:
        """The figures of all streams; one without samples is included."""
        return tuple(
            StreamFigures(_label(name, source), source.text, pace.samples, pace.rate, pace.largest_gap)
            for name, source, pace in self._paces
        )

    @property
    def problems(self) -> dict[str, str]:
        """{stream: why it has no samples, or which samples were rejected}."""
        return self._streams.problems

    def silent(self, now: float) -> dict[str, float]:
        """{stream as it was named: for how long (s)} of those that are silent."""
        found = {source.text: pace.silent(now) for _, source, pace in self._paces}
        return {text: quiet for text, quiet in found.items() if quiet}

    def _feed(self, finder: WindowFinder) -> None:
        """Hand the samples to the finder once slider and pusher have been seen; until then it would keep them all."""
        if not (self._streams.received["slider"] and self._streams.received["pusher"]):
            return
        while self._early:
            samples = self._early.popleft()
            finder.add_wrench(samples.wrench)
            finder.add_pusher(samples.pusher)
            finder.add_slider(samples.slider)

    def _count(self, windows: list[PushWindow]) -> None:
        self.windows += len(windows)
        self._pushes.update(window.push_id for window in windows)


def _label(name: str, source: Source) -> str:
    return source.text if name == COVARIATE else name
