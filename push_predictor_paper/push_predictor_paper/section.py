# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A section of the report: findings, tables and pictures."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from push_predictor.evaluation.estimate import Estimate
from push_predictor.reporting.canvas import Picture, draw
from push_predictor_paper.verdict import Evidence

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

OUTPUT_NAMES = ("dx", "dy", "rotation")


class TooFewError(Exception):
    """The data are too few for the claims of a section. The message states what they lack."""


@dataclass(frozen=True)
class Number:
    """An estimate in a cell of a table, with the format of its text. The JSON has it unrounded."""

    estimate: Estimate
    form: str = ".2f"

    def cell(self) -> str:
        """The value, its interval beneath."""
        return self.estimate.cell(self.form)

    def json(self) -> dict[str, float | None]:
        """Value, low and high."""
        return self.estimate.json()


@dataclass(frozen=True)
class Table:
    """A table of texts, counts and numbers. The caption states the pushes, the split and the kind of interval."""

    caption: str
    head: tuple[str, ...]
    rows: Sequence[Sequence[object]]

    @property
    def texts(self) -> list[list[str]]:
        """The text of every cell; the interval of a number is its second line."""
        return [[cell.cell() if isinstance(cell, Number) else str(cell) for cell in row] for row in self.rows]

    def json(self) -> dict[str, Any]:
        """Caption, and a list of rows by head."""
        rows = [[cell.json() if isinstance(cell, Number) else cell for cell in row] for row in self.rows]
        return {"caption": self.caption, "rows": [dict(zip(self.head, row, strict=True)) for row in rows]}

    def csv(self) -> str:
        """Head and rows as CSV; the second line of cells has a column of its own. ASCII minus signs."""
        rows = [[cell.replace("−", "-").partition("\n") for cell in row] for row in self.texts]
        double = [any(row[k][1] for row in rows) for k in range(len(self.head))]
        lines: list[Iterable[tuple[str, str]]] = [[(name, f"{name}, interval") for name in self.head]]
        lines += [[(first, second) for first, _, second in row] for row in rows]
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(
            [part for cell, two in zip(line, double, strict=True) for part in cell[: 1 + two]] for line in lines
        )
        return text.getvalue()


@dataclass(frozen=True)
class Section:
    """What a section found. evidence: by claim (see claims.CLAIMS); notes: on the data and the method."""

    evidence: Mapping[str, Evidence]
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()
    notes: Sequence[str] = ()


def speed_text(speed: float) -> str:
    """A speed (m/s) in words: 20 mm/s."""
    return f"{1e3 * speed:.0f} mm/s"


def picture(path: Path, size: tuple[float, float], paint: Callable[[Canvas], None], caption: str) -> Picture:
    """Draw a picture of that size (inches). The first sentence of the caption is also its alternative text."""
    return Picture(draw(path, size, paint), caption.partition(". ")[0], caption)
