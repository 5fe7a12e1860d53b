# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What is found in messages while they are recorded: samples, their pace, windows, contact."""

from __future__ import annotations

from collections import deque

import numpy as np

from push_predictor.errors import RecordingError
from push_predictor.online.recorder_progress import Pace
from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.decoder.decoder import Samples, StreamDecoder, key_of
from push_predictor.recordings.decoder.sources import COVARIATE, POSES, STREAMS, sources_of
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.push_window import PushWindow

EARLY = 30  # portions that wait for the rig and for the first sample of slider and pusher


class Findings:
    """Takes messages as they are recorded.

    topics: with full names; now: the time (s) from which on messages are expected; windows: number of them so far;
    paces: of all streams, also of one without samples.
    """

    def __init__(self, topics: Topics, now: float) -> None:
        self.windows = 0
        self._decoder = StreamDecoder(topics)
        self._refused: dict[str, str] = {}
        self._types: dict[str, str] = {}
        self._waiting: dict[str, tuple[list[int], list[bytes]]] = {}
        self.paces = tuple(
            Pace(now, source.text if name == COVARIATE else name, source.text, source.topic)
            for name, source in sources_of(topics)
        )
        self._finder: WindowFinder | None = None
        self._early: deque[Samples] = deque(maxlen=EARLY)
        self._pushes: set[str] = set()

    def add_topic(self, topic: str, type_name: str, schema: str) -> None:
        """State the type of a topic; schema: its definition, '' if unknown. One that does not fit becomes a problem."""
        self._types[topic] = type_name
        for name, source in sources_of(self._decoder.topics):
            if name not in STREAMS or key_of(source.topic) != key_of(topic):
                continue
            try:
                source.check_type(type_name, "")
                if not source.frame:
                    self._decoder.inputs()[name].declare(type_name, {type_name: schema})
            except RecordingError as error:
                self._refused[name] = str(error)

    def set_rig(self, rig: Rig) -> None:
        """Find windows of this rig from now on, and in the last EARLY portions."""
        self._decoder.begin(rig)
        self._finder = WindowFinder(rig)

    def put(self, topic: str, log_time: int, data: bytes) -> None:
        """Add a message; log_time in ns."""
        times, messages = self._waiting.setdefault(topic, ([], []))
        times.append(log_time)
        messages.append(data)

    def work(self, now: float, last: bool = False) -> None:
        """Evaluate the portion of messages since the last call; last: no more will come."""
        logged = {topic: np.array(times, np.int64) for topic, (times, _) in self._waiting.items()}
        for topic, (times, data) in self._waiting.items():
            if topic in self._types:
                self._decoder.put(Messages.of(topic, self._types[topic], times, data), logged[topic])
        self._waiting = {}
        samples = self._decoder.take(last)
        stamps = {"slider": samples.slider.stamp, "pusher": samples.pusher.stamp, "wrench": samples.wrench.stamp}
        for pace in self.paces:
            of_topic = logged.get(pace.topic, np.empty(0, np.int64))
            pace.add(stamps.get(pace.name, of_topic), now)
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
    def problems(self) -> dict[str, str]:
        """{stream: why it has no samples, or which samples were rejected}."""
        found = {}
        for name, source in sources_of(self._decoder.topics):
            if name not in STREAMS:
                continue
            own = self._decoder.of(name)
            if own.rejected:
                kinds = ", ".join(f"{kind} {count}" for kind, count in own.rejected.items())
                found[name] = f"{source.text}: {own.rejected.total()} samples were rejected ({kinds})."
            if problem := self._decoder.problem(name):
                found[name] = f"{source.error('', problem)}."
        return found | self._refused

    def silent(self, now: float) -> dict[str, float]:
        """{stream as it was named: for how long (s)} of those that are silent."""
        found = {pace.source: pace.silent(now) for pace in self.paces}
        return {text: quiet for text, quiet in found.items() if quiet}

    def _feed(self, finder: WindowFinder) -> None:
        """Hand the samples to the finder once slider and pusher have been seen; until then it would keep them all."""
        if not all(pace.samples for pace in self.paces if pace.name in POSES):
            return
        while self._early:
            samples = self._early.popleft()
            finder.add_wrench(samples.wrench)
            finder.add_pusher(samples.pusher)
            finder.add_slider(samples.slider)

    def _count(self, windows: list[PushWindow]) -> None:
        self.windows += len(windows)
        self._pushes.update(window.push_id for window in windows)
