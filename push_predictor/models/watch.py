"""The callback by which long computations report their progress."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Watch: TypeAlias = Callable[[str, float], None]  # takes what is being done and the fraction that is done, 0 to 1


def no_watch(stage: str, fraction: float) -> None:
    """Report nothing."""
