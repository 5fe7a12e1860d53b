"""What a process takes, from /proc: memory, threads, file descriptors; and whether that grows."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

MEGABYTE = 1024.0 * 1024.0


@dataclass(frozen=True)
class Vitals:
    """At a time (s, monotonic): resident memory (MB), threads, open file descriptors."""

    time: float
    memory: float
    threads: int
    descriptors: int

    def __str__(self) -> str:
        return f"{self.memory:7.2f} MB {self.threads:3d} threads {self.descriptors:3d} descriptors"


def vitals(process: int) -> Vitals:
    """Of the process with this id. Raises OSError if there is none."""
    folder = Path("/proc") / str(process)
    pages = int((folder / "statm").read_text().split()[1])
    threads = len(os.listdir(folder / "task"))
    memory = pages * os.sysconf("SC_PAGE_SIZE") / MEGABYTE
    return Vitals(monotonic(), memory, threads, len(os.listdir(folder / "fd")))


@dataclass(frozen=True)
class Growth:
    """From the first fifth after the warm-up to the last: memory (MB) by their means, and its highest; threads and
    descriptors by the fewest or the most, whichever grew less: a file may be open or closed for a moment; a leak shows
    in both.
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
    """After so many seconds of the first; seen: in order, one at least."""
    warm = [v for v in seen if v.time >= seen[0].time + warm_up] or list(seen[-1:])
    part = max(1, len(warm) // 5)
    first, last = warm[:part], warm[-part:]
    before, after = (sum(v.memory for v in some) / part for some in (first, last))
    return Growth(
        after - before,
        max(v.memory for v in warm) - before,
        _more([v.threads for v in first], [v.threads for v in last]),
        _more([v.descriptors for v in first], [v.descriptors for v in last]),
    )


def _more(first: Sequence[int], last: Sequence[int]) -> int:
    return min(min(last) - min(first), max(last) - max(first))
