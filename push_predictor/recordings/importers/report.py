# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report of an import: what was written, dropped, repaired and assumed."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path


@dataclass
class Notes:
    """Sentences collected while files are read; each names the file, and the line or count."""

    dropped: list[str] = field(default_factory=list)
    repaired: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)

    def assume(self, sentence: str) -> None:
        """Add an assumption once, even if several files share it."""
        if sentence not in self.assumed:
            self.assumed.append(sentence)


@dataclass(frozen=True)
class ImportReport:
    """The result of an import.

    recordings: number of recordings written. pushes: number of pushes known from the format: the rows of a table, one
    for a file with one push, none for a continuous bag, whose windows must be found first.
    """

    kind: str
    written: tuple[Path, ...]
    recordings: int
    pushes: int
    dropped: tuple[str, ...] = ()
    repaired: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()

    def to_json(self) -> dict[str, object]:
        """The report as JSON values."""
        return {**asdict(self), "written": [str(path) for path in self.written]}

    def __str__(self) -> str:
        head = f"import {self.kind}: {self.recordings} recordings, {self.pushes} pushes"
        parts = [("written", [str(path) for path in self.written])]
        parts += [(name, list(getattr(self, name))) for name in ("dropped", "repaired", "assumed")]
        return "\n".join([head, *(line for name, items in parts for line in _listed(name, items))])


def _listed(name: str, items: list[str]) -> list[str]:
    return [f"{name}:", *(f"  - {item}" for item in items)] if items else [f"{name}: nothing"]
