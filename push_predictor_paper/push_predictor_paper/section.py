# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a claim contributes to the report: findings, tables, pictures, numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from push_predictor.reporting.canvas import Picture
from push_predictor.reporting.html import NOTHING

Verdict = Literal["holds", "holds in part", "does not hold", "not decided"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
Origin = Literal["paper", "beyond the paper"]


@dataclass(frozen=True)
class Finding:
    """A claim in our words, its verdict, and the evidence: numbers with intervals, then the rule of the verdict.

    number: the one that decides, with its interval, for the summary. origin: the paper, or a question that the paper
    does not ask.
    """

    claim: str
    verdict: Verdict
    sentence: str
    origin: Origin = "paper"
    number: str = field(default=NOTHING, kw_only=True)


@dataclass(frozen=True)
class Table:
    """A table of text for html.table. The caption states the pushes, the split and the kind of interval."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Section:
    """One section of the report. data: its numbers, for the JSON, with None in place of NaN."""

    key: str
    title: str
    findings: tuple[Finding, ...]
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    notes: tuple[str, ...] = ()
    data: Mapping[str, Any] = field(default_factory=dict)


def joined(key: str, title: str, parts: Sequence[tuple[str, Section]]) -> Section:
    """Join sections into one; parts: (title of the corpus, its section). The parts' own keys and titles are dropped."""

    def every(field_name: str) -> tuple[Any, ...]:
        return tuple(item for _, part in parts for item in getattr(part, field_name))

    data = {name: part.data for name, part in parts}
    return Section(key, title, every("findings"), every("tables"), every("pictures"), every("notes"), data)
