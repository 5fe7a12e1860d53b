# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The callback by which long computations report their progress."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias, TypeVar

Watch: TypeAlias = Callable[[str, float], None]  # takes what is being done and the fraction that is done, 0 to 1
T = TypeVar("T")


def no_watch(stage: str, fraction: float) -> None:
    """Report nothing."""


def part_of(watch: Watch, begin: float, end: float) -> Watch:
    """A watch for a part of the work, between these shares of the whole."""
    return lambda stage, done: watch(stage, begin + (end - begin) * done)


def watched(items: Sequence[T], watch: Watch, stage: str) -> Iterator[T]:
    """The items in turn; reports the stage with the share of the items before each, and after the last."""
    for done, item in enumerate(items):
        watch(f"{stage} {done + 1} of {len(items)}", done / len(items))
        yield item
    watch(stage, 1.0)
