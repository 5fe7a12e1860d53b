# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The checks of a recording while it is made: over the samples so far, again each time that there are twice as many."""

from __future__ import annotations

from push_predictor.online.check_process import CheckProcess
from push_predictor.recordings.decoder.decoder import Samples
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording, joined
from push_predictor.recordings.windows.clock_set import set_back

FIRST = 1000  # samples of the slider's pose before the first check
MOST = 50_000  # samples of a stream that are kept: 200 s at 250 Hz, 2 MB


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
