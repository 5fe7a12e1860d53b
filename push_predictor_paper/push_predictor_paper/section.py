"""What one claim gives to the report: findings, tables, pictures, numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from push_predictor.reporting.canvas import Picture

Verdict = Literal["holds", "holds in part", "does not hold", "not decided"]
Origin = Literal["paper", "beyond the paper"]


@dataclass(frozen=True)
class Finding:
    """A claim in our words, whether it holds here, and the sentence with number and interval for it.

    The verdict follows from the numbers by a rule that the sentence lets the reader see. origin: who claims it; what
    the paper does not say is ours to ask.
    """

    claim: str
    verdict: Verdict
    sentence: str
    origin: Origin = "paper"


@dataclass(frozen=True)
class Table:
    """A table of text: caption (which pushes, which split, which interval), head, rows; see html.table."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Section:
    """One section of the report. data: the numbers behind it, for the JSON; NaN is not allowed, give None."""

    key: str
    title: str
    findings: tuple[Finding, ...]
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    notes: tuple[str, ...] = ()
    data: Mapping[str, Any] = field(default_factory=dict)


def joined(key: str, title: str, parts: Sequence[tuple[str, Section]]) -> Section:
    """One section of what each corpus gave, with the corpus' title; the parts' own keys and titles are dropped."""

    def every(field_name: str) -> tuple[Any, ...]:
        return tuple(item for _, part in parts for item in getattr(part, field_name))

    data = {name: part.data for name, part in parts}
    return Section(key, title, every("findings"), every("tables"), every("pictures"), every("notes"), data)
