# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The checks of a recording in a process of their own: samples must not wait for a fit of some tenths of a second.

While a recording is made, the samples so far are checked again each time that there are twice as many.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.online.child_process import Child, Failure
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.decoder.decoder import Samples
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording, joined, set_back
from push_predictor.recordings.topics import Topics

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

PENDING = "not checked yet"
FIRST = 1000  # samples of the slider's pose before the first check
MOST = 50_000  # samples of a stream that are kept: 200 s at 250 Hz, 2 MB


class CheckProcess:
    """Checks one recording at a time. Call `work` often, from one thread.

    findings: refusals and warnings of the last check that ended. result: in words, what it found. failure: why the
    recording could not be checked, empty if it could. strict: a warning is an error too.
    """

    def __init__(self, strict: bool = False) -> None:
        self._failing = ("refused", "warning") if strict else ("refused",)
        self._child = Child("check", _check)
        self.findings: tuple[Finding, ...] = ()
        self.result, self.failure = PENDING, ""

    @property
    def busy(self) -> bool:
        """Whether a check runs."""
        return self._child.started

    @property
    def failed(self) -> bool:
        """Whether a finding is an error."""
        return any(finding.severity in self._failing for finding in self.findings)

    @property
    def problems(self) -> list[str]:
        """The findings in words."""
        return [finding.text for finding in self.findings]

    def start(self, data: Recording | Path, rig: Rig | None, topics: Topics = Topics()) -> None:
        """Check a recording, or that of a path and its topics, if no check runs. rig: None for the recorded one."""
        if not self.busy:
            self._child.start(data, rig, topics)

    def work(self) -> None:
        """Take the result if it is there."""
        if (reply := self._child.received()) is None:
            return
        self.stop()
        if isinstance(reply, Failure):
            self.skip(reply.reason)
            return
        self.failure = ""
        self.findings = tuple(finding for finding in reply if finding.severity != "note")
        self.result = ", ".join(finding.name for finding in self.findings) or "sound"

    def skip(self, why: str) -> None:
        """Report that a recording is not checked."""
        self.failure, self.result = why, f"not checked: {why}"

    def stop(self) -> None:
        """End the process."""
        self._child.stop()


def _check(connection: Connection, data: Recording | Path, rig: Rig | None, topics: Topics) -> None:
    from push_predictor.recordings.checks.check import check_recording
    from push_predictor.recordings.read import read_recording, require_rig

    recording = read_recording(data, rig=rig, topics=topics) if isinstance(data, Path) else data
    connection.send(check_recording(recording, rig or require_rig(recording)))


class SampleCheck:
    """Keeps the last MOST samples of each stream. check: the process, with its findings. Call `work` often."""

    def __init__(self, rig: Rig, strict: bool = False) -> None:
        self.check = CheckProcess(strict)
        self._rig = rig
        self._portions: list[Samples] = []
        self._kept, self._since, self._next = 0, 0, FIRST

    def add(self, samples: Samples) -> None:
        """Add a portion of the streams."""
        if not len(samples):
            return
        if self._portions and set_back(self._portions[-1].slider, samples.slider):
            self._portions, self._kept = [], 0
        self._portions.append(samples)
        self._kept += len(samples.slider)
        self._since += len(samples.slider)
        while self._kept > MOST and len(self._portions) > 1:
            self._kept -= len(self._portions.pop(0).slider)

    def work(self) -> None:
        """Take a result; begin a check once enough samples have arrived since the last."""
        self.check.work()
        if self._since < self._next or self._kept < FIRST or self.check.busy:
            return
        self._since, self._next = 0, min(2 * self._next, MOST)
        self.check.start(self._recording(), self._rig)

    def _recording(self) -> Recording:
        slider = joined([portion.slider for portion in self._portions])
        pusher = joined([portion.pusher for portion in self._portions])
        wrench = joined([portion.wrench for portion in self._portions])
        return Recording("samples so far", self._rig, slider, pusher, wrench if len(wrench) else None)
