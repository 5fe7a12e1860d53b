# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Memory, threads and file descriptors of a process, from /proc, and their growth."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

MEGABYTE = 1024.0 * 1024.0


@dataclass(frozen=True)
class Vitals:
    """Resident memory (MB), threads and open file descriptors at a time (s, monotonic)."""

    time: float
    memory: float
    threads: int
    descriptors: int

    def __str__(self) -> str:
        return f"{self.memory:7.2f} MB {self.threads:3d} threads {self.descriptors:3d} descriptors"


def vitals(process: int) -> Vitals:
    """Read the vitals of the process with this id. Raises OSError if there is none."""
    folder = Path("/proc") / str(process)
    pages = int((folder / "statm").read_text().split()[1])
    threads = len(os.listdir(folder / "task"))
    memory = pages * os.sysconf("SC_PAGE_SIZE") / MEGABYTE
    return Vitals(monotonic(), memory, threads, len(os.listdir(folder / "fd")))


def memory_of(process: int, key: str) -> float:
    """Memory of a process, MB; key: VmRSS (resident now) or VmHWM (at most so far)."""
    lines = (Path("/proc") / str(process) / "status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(key)) / 1024.0


@dataclass(frozen=True)
class Growth:
    """Growth after the warm-up.

    memory: difference of the means of the first and of the last fifth, MB; highest: largest excess over the first mean.
    threads and descriptors: from the first half to the last, growth of the minimum or of the maximum, whichever is
    smaller. A leak shows in both; a file that is open for some seconds at a time, as a recording between two loops, in
    one.
    """

    memory: float
    highest: float
    threads: int
    descriptors: int

    def __str__(self) -> str:
        return (
            f"memory {self.memory:+.2f} MB (at most {self.highest:+.2f}), threads {self.threads:+d}, "
            f"descriptors {self.descriptors:+d}"
        )


def growth(seen: Sequence[Vitals], warm_up: float) -> Growth:
    """Growth after `warm_up` seconds; seen: in order of time, one at least."""
    warm = [v for v in seen if v.time >= seen[0].time + warm_up] or list(seen[-1:])
    part, half = max(1, len(warm) // 5), max(1, len(warm) // 2)
    before, after = (sum(v.memory for v in some) / part for some in (warm[:part], warm[-part:]))
    first, last = warm[:half], warm[-half:]
    return Growth(
        after - before,
        max(v.memory for v in warm) - before,
        _more([v.threads for v in first], [v.threads for v in last]),
        _more([v.descriptors for v in first], [v.descriptors for v in last]),
    )


def _more(first: Sequence[int], last: Sequence[int]) -> int:
    return min(min(last) - min(first), max(last) - max(first))
