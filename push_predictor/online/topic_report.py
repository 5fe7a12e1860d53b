# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report about a live topic: type, reliability, rate, frame, jitter of the stamps, latency, what is wrong."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from push_predictor.recordings.windows.regular_stamps import stamp_noise
from push_predictor.types import IntArray

SAME_CLOCK = 10.0  # s; a greater latency means that the stamps are of another clock


@dataclass(frozen=True)
class TopicReport:
    """What is known of a topic. stream: slider, pusher or wrench; kind: the message type; reliability: '' without one.

    refused: whether the topic cannot be used as it is. figures: in words, empty before enough messages came.
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


class ReportLog:
    """Which reports are news: a report is logged when it differs from the one before, and stays so for a second look.

    A refusal is logged at once.
    """

    def __init__(self) -> None:
        self._logged: dict[str, tuple[object, ...]] = {}
        self._seen: dict[str, tuple[object, ...]] = {}

    def news(self, reports: Iterable[TopicReport]) -> list[TopicReport]:
        """The reports to log now."""
        found = []
        for report in reports:
            stable = self._seen.get(report.stream) == report.key
            self._seen[report.stream] = report.key
            if (stable or report.refused) and self._logged.get(report.stream) != report.key:
                self._logged[report.stream] = report.key
                found.append(report)
        return found
