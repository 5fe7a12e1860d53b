# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Independent calls, run on all cores by joblib, and cached on disk.

The cache belongs to one state of the sources: after a change of a module that matters, results are computed again.
"""

from __future__ import annotations

import hashlib
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar

import joblib
import numpy as np
import scipy

import push_predictor
from push_predictor.watch import Watch, no_watch

Result = TypeVar("Result")
LOOKS = (  # modules that change how results look, not what they are
    "push_predictor/evaluation/report/page.py",
    "push_predictor/evaluation/report/tables.py",
    "push_predictor_paper/report.py",
    "push_predictor_paper/section.py",
    "push_predictor_paper/claims.py",
    "push_predictor_paper/verdict.py",
)
NO_RESULTS = (  # folders on which no cached result depends
    "reporting",
    "figures",
    "nodes",
    "replay",
    "online",
    "commands",
    "sections",
    "painters",
    "residuals",
)


class Work:
    """A cache of calls, and the processes that fill it. A call made before, also by another process, is read from disk.

    folder: of the cache; cores: calls at the same time, -1 for one per core. watch: sees each call.
    """

    def __init__(self, folder: Path, cores: int = -1) -> None:
        self._cores = cores
        self.watch: Watch = no_watch
        self.folder = folder / fingerprint()
        self._memory = joblib.Memory(self.folder, verbose=0)

    def run(self, doing: str, function: Callable[..., Result], calls: Sequence[tuple[Any, ...]]) -> list[Result]:
        """Results of function(*arguments) for each call, in order. The function is one at the top of a module."""
        count = len(calls)
        self.watch(f"{doing} 0 of {count}", 0.0)
        kept = self._memory.cache(function)
        parallel = joblib.Parallel(n_jobs=self._cores, return_as="generator_unordered", batch_size=1)
        results: dict[int, Result] = {}
        pieces = (joblib.delayed(_numbered)(i, kept, arguments) for i, arguments in enumerate(calls))
        with _interruption() as interrupted:
            for i, result in parallel(pieces):
                results[i] = result
                self.watch(f"{doing} {len(results)} of {count}", len(results) / count)
                if interrupted:
                    raise KeyboardInterrupt
        return [results[i] for i in range(count)]


@contextmanager
def _interruption() -> Iterator[list[int]]:
    """The signals of an interruption so far: joblib swallows the KeyboardInterrupt that comes while it stores."""
    signals: list[int] = []
    handler = signal.getsignal(signal.SIGINT)
    if not callable(handler) or threading.current_thread() is not threading.main_thread():
        yield signals
        return

    def note(number: int, frame: FrameType | None) -> None:
        signals.append(number)
        handler(number, frame)

    signal.signal(signal.SIGINT, note)
    try:
        yield signals
    finally:
        signal.signal(signal.SIGINT, handler)


@cache
def fingerprint() -> str:
    """A digest of the sources of both packages on which results depend, and of the versions of numpy and scipy."""
    digest = hashlib.sha256(f"numpy {np.__version__}, scipy {scipy.__version__}".encode())
    for package in (Path(push_predictor.__file__).parent, Path(__file__).parent):
        for path in sorted(package.rglob("*.py")):
            inside = path.relative_to(package.parent)
            if inside.as_posix() not in LOOKS and not set(inside.parts) & set(NO_RESULTS):
                digest.update(inside.as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def _numbered(i: int, function: Callable[..., Result], arguments: tuple[Any, ...]) -> tuple[int, Result]:
    with warnings.catch_warnings():  # joblib warns when a busy machine is slow to store arguments
        warnings.filterwarnings("ignore", message="Persisting input arguments")
        return i, function(*arguments)
