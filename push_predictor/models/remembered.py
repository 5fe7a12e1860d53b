# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A cache of results for arrays of rows, which `functools.lru_cache` does not take."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from numpy.typing import NDArray

Found = TypeVar("Found")
MOST_REMEMBERED, MOST_ROWS = 4, 50_000  # results, and rows of one: a batch of a million would take 100 MB


class Remembered(Generic[Found]):
    """The last few results of several rows: moments, densities, correlation and tails of the same rows share them."""

    def __init__(self) -> None:
        self._known: dict[bytes, Found] = {}

    def of(self, compute: Callable[[], Found], *given: NDArray[Any]) -> Found:
        """The result for these arrays, computed if it is not known. It must not be changed."""
        if not 1 < len(given[0]) <= MOST_ROWS:
            return compute()
        key = b"".join(each.tobytes() for each in given)
        if (known := self._known.get(key)) is None:
            known = compute()
            self._known = dict([*self._known.items(), (key, known)][-MOST_REMEMBERED:])
        return known
