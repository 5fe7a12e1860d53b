# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a validator reports of its live streams: each topic, and whether the streams are in step.

In a fast replay the middleware may delay one of them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from time import monotonic

import numpy as np

from push_predictor.recordings.decoder.decoder import Samples
from push_predictor.recordings.windows.clock_session import LONGEST_LAG
from push_predictor.recordings.windows.finder import LONGEST_GAP
from push_predictor.recordings.windows.regular_stamps import stamp_noise
from push_predictor.recordings.windows.stream_faults import CLOCK_TOLERANCE, describe_clock_offset
from push_predictor.types import IntArray

SAME_CLOCK = 10.0  # s; a greater latency means that the stamps are of another clock
SILENT = 2.0  # s without a sample after which a stream is called silent
PATIENCE = 5.0  # s of waiting for a stream that lags behind
# ns; the finder proceeds without a stream that lags by twice as much
SENSOR_LAG, SCALAR_LAG = 0.5e9 * LONGEST_LAG, 0.5 * LONGEST_GAP
LAGS = 50  # portions of a stream over which its stamps are compared with the slider's


@dataclass(frozen=True)
class TopicReport:
    """What is known of a topic. stream: slider, pusher, wrench or the name of a scalar; kind: the message type.

    reliability: '' without a subscription. refused: whether a sensor's topic cannot be used as it is. figures: in
    words, empty before enough messages came.
    """

    stream: str
    topic: str
    kind: str
    reliability: str
    frames: tuple[str, ...] = ()
    figures: str = ""
    problem: str = ""
    refused: bool = False
    note: str = ""

    @property
    def key(self) -> tuple[object, ...]:
        """What has to change for the line to be logged again: not its figures."""
        return self.topic, self.kind, self.reliability, self.frames, self.problem, self.note, bool(self.figures)

    @property
    def line(self) -> str:
        """The report in one line."""
        parts = [self.topic, self.kind, self.reliability]
        parts += [f"frame_id {' and '.join(map(repr, self.frames))}"] if self.frames else []
        text = f"{self.stream}: {', '.join(filter(None, [*parts, self.figures]))}"
        return " ".join([f"{text}.", *filter(None, (self.problem, self.note))])


def stamp_figures(stamp: IntArray, received: IntArray | None) -> str:
    """Rate, jitter (standard deviation of a stamp) and latency of messages, in words; empty for too few.

    stamp (n,), received (n,): in ns, in order; received: None if it is not known. A great latency means that the stamps
    are of another clock than that of this machine, as in a replay.
    """
    if (noise := stamp_noise(stamp)) is None:
        return ""
    found = f"{1.0 / noise.period:.1f} Hz, stamp jitter {1e3 * noise.jitter:.2g} ms"
    if received is None:
        return found
    latency = 1e-9 * float(np.median(received - stamp))
    return f"{found}, " + (
        "stamps of another clock" if abs(latency) > SAME_CLOCK else f"latency {1e3 * latency:.2g} ms"
    )


class StreamSync:
    """Records for each stream its newest stamp, and since when it lags behind the foremost sensor.

    scalars: topics to wait for although they have not sent anything.
    """

    def __init__(self, scalars: Sequence[str] = ()) -> None:
        self._sensors: dict[str, int] = {}  # newest stamp (ns)
        self._scalars: dict[str, int | None] = dict.fromkeys(scalars)
        self._together = dict.fromkeys(scalars, monotonic())
        self._heard: dict[str, float] = {}  # when a sensor's last sample came
        self._lags: dict[str, deque[float]] = {}  # s, of the other sensors' stamps from the slider's

    def note(self, samples: Samples) -> None:
        """Take note of a portion of the streams."""
        stamps = {"slider": samples.slider.stamp, "pusher": samples.pusher.stamp, "wrench": samples.wrench.stamp}
        newest = {name: int(stamp[-1]) for name, stamp in stamps.items() if len(stamp)}
        self._sensors |= newest
        self._heard |= dict.fromkeys(newest, monotonic())
        for name in newest.keys() - {"slider"}:
            if "slider" in self._sensors:
                lag = 1e-9 * (newest[name] - self._sensors["slider"])
                self._lags.setdefault(name, deque(maxlen=LAGS)).append(lag)
        self._scalars |= {name: int(stream.stamp[-1]) for name, stream in samples.scalars.items() if len(stream)}

    def in_step(self) -> bool:
        """Whether no stream lags, except those that have lagged for PATIENCE. Ask often: the waiting is timed here."""
        foremost, now = max(self._sensors.values(), default=0), monotonic()
        near = {name: foremost - stamp < SENSOR_LAG for name, stamp in self._sensors.items()}
        near |= {name: stamp is not None and foremost - stamp < SCALAR_LAG for name, stamp in self._scalars.items()}
        self._together |= {name: now for name, is_near in near.items() if is_near}
        return all(ok or now - self._together.setdefault(name, now) > PATIENCE for name, ok in near.items())

    def apart(self) -> dict[str, float]:
        """By how much (s) the stamps of a stream stay ahead of (or behind) the slider's, for those that do.

        Of a stream that has stopped they tell nothing.
        """
        stopped = {*self.silent()}
        compared = (
            {} if "slider" in stopped else {name: lags for name, lags in self._lags.items() if name not in stopped}
        )
        nearest = {name: min(lags, key=abs) for name, lags in compared.items() if len(lags) == LAGS}
        return {name: lag for name, lag in nearest.items() if abs(lag) > CLOCK_TOLERANCE}

    def silent(self) -> list[str]:
        """The sensors that have stopped while others continue."""
        newest = max(self._heard.values(), default=0.0)
        return [name for name, heard in self._heard.items() if newest - heard > SILENT]

    @property
    def with_wrench(self) -> bool:
        """Whether a wrench was received."""
        return "wrench" in self._sensors

    def problems(self) -> list[str]:
        """What keeps windows from being found, in words."""
        found = [describe_clock_offset(name, lag) for name, lag in self.apart().items()]
        return found + [
            f"No sample from the {name} for {SILENT:g} s, others continue: no window can be found."
            for name in self.silent()
        ]
