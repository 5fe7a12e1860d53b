# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The result of one check of the installation."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal, TypeAlias

State: TypeAlias = Literal["ok", "note", "missing"]


@dataclass(frozen=True)
class Finding:
    """Result of one check. missing: something required is absent; note: something optional is.

    why states what this means, remedy how to fix it, as a command where possible. Both are empty if all is well.
    """

    name: str
    state: State
    found: str
    why: str = ""
    remedy: str = ""

    @property
    def lines(self) -> list[str]:
        """Lines to print: the finding, what it means, how to fix it."""
        below = [f"{'':25s}{text}" for text in (self.why, self.remedy and f"-> {self.remedy}") if text]
        return [f"{self.state:8s} {self.name:15s} {self.found}", *below]

    def record(self) -> dict[str, str]:
        """The entry in the JSON."""
        return asdict(self)
