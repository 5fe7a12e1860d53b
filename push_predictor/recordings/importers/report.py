"""What an import did, told to the person who will trust the result."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path


@dataclass
class Notes:
    """Sentences gathered while foreign files are read; each names the file, and the line or count."""

    dropped: list[str] = field(default_factory=list)
    repaired: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)

    def assume(self, sentence: str) -> None:
        """Add an assumption once, however many files share it."""
        if sentence not in self.assumed:
            self.assumed.append(sentence)


@dataclass(frozen=True)
class ImportReport:
    """What was written and what was done to it.

    recordings: recordings written. pushes: pushes known from the format itself (a table's rows, one for a file that
    holds one push, none for a continuous bag, where windows must be found first).
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
