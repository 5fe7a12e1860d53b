# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The stages of the demo with the share of its work that is done before each, and the pages that it makes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple


class Page(NamedTuple):
    """A page or picture that the demo made, and what it shows."""

    path: Path
    shows: str


class Stages:
    """Prints the stages. shares: usual durations of all stages, in order, in any unit."""

    def __init__(self, shares: Sequence[float]) -> None:
        self._shares, self._begun, self._stage = shares, time.monotonic(), 0

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self._begun

    def begin(self, title: str) -> None:
        """Print number and title of the next stage, and percent and time of the demo so far."""
        done = 100.0 * sum(self._shares[: self._stage]) / sum(self._shares)
        self._stage += 1
        print(f"[{done:3.0f} %, {self.elapsed:3.0f} s] {self._stage}. {title}", flush=True)
