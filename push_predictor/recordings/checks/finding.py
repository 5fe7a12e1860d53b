# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The result of one check of a recording or a push table."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Literal, TypeAlias

Severity: TypeAlias = Literal["refused", "warning", "note"]


@dataclass(frozen=True)
class Value:
    """An estimated number, its unit, and its standard deviation in the same unit (None if none is known)."""

    value: float
    unit: str
    sd: float | None = None


@dataclass(frozen=True)
class Finding:
    """A probable mistake. refused: nothing can be learnt from these data; warning: check before learning.

    sentence states what was found, advice what to do. values: estimates by name.
    """

    name: str
    severity: Severity
    sentence: str
    advice: str
    values: dict[str, Value] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The finding and the advice, in one line."""
        return f"{self.sentence} {self.advice}"

    @property
    def lines(self) -> list[str]:
        """Lines to print: the finding and, below it, the advice."""
        return [f"{self.severity:8s} {self.name:16s} {self.sentence}", f"{'':25s} -> {self.advice}"]

    def record(self) -> dict[str, object]:
        """The entry in the JSON."""
        return asdict(self)
