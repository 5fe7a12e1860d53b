"""What a check of the installation found."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal, TypeAlias

State: TypeAlias = Literal["ok", "note", "missing"]


@dataclass(frozen=True)
class Finding:
    """One check. missing: something needed is not there; note: something that may be wanted.

    why and remedy, both in words, are empty where all is well; a remedy is a command where one helps.
    """

    name: str
    state: State
    found: str
    why: str = ""
    remedy: str = ""

    @property
    def lines(self) -> list[str]:
        """For people: what was found, and below it what that means and what mends it."""
        below = [f"{'':25s}{text}" for text in (self.why, self.remedy and f"-> {self.remedy}") if text]
        return [f"{self.state:8s} {self.name:15s} {self.found}", *below]

    def record(self) -> dict[str, str]:
        """For machines."""
        return asdict(self)
