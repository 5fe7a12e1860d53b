# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of the report as files: CSV for programs, LaTeX for papers."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from push_predictor.recordings.atomic import write_whole
from push_predictor_paper.section import Section, Table

FOLDER = "tables"
LATEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "−": "$-$", "–": "--", "±": r"$\pm$", "°": r"$^\circ$",
    "×": r"$\times$", "Δ": r"$\Delta$", "θ": r"$\theta$", "β": r"$\beta$", "<": "$<$", ">": "$>$", "|": "$|$",
}  # fmt: skip


def write_tables(out: Path, sections: Sequence[Section]) -> dict[str, list[dict[str, str]]]:
    """Write every table to out/tables as CSV and as LaTeX; return the addresses relative to out, by key of the section.

    The list of a section has one entry per table, from "CSV" and "LaTeX" to the address. Raises OSError.
    """
    (out / FOLDER).mkdir(parents=True, exist_ok=True)
    return {
        section.key: [_write(out, section.key, n, table) for n, table in _numbered(section)] for section in sections
    }


def to_csv(table: Table) -> str:
    """Head and rows; the second line of cells, such as an interval, has a column of its own. ASCII minus signs."""
    text = io.StringIO()
    rows = [[_plain(cell) for cell in row] for row in _spread(table)]
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def to_latex(table: Table, label: str) -> str:
    """A floating table with caption; it needs the package booktabs."""
    columns = "l" + "r" * (len(table.head) - 1)
    body = [_latex_row(row) for row in table.rows]
    return "\n".join(
        (
            r"\begin{table}",
            rf"  \caption{{{_escaped(table.caption)}}}",
            rf"  \label{{tab:{label}}}",
            rf"  \begin{{tabular}}{{{columns}}}",
            r"    \toprule",
            f"    {_latex_row(table.head)}",
            r"    \midrule",
            *(f"    {row}" for row in body),
            r"    \bottomrule",
            r"  \end{tabular}",
            r"\end{table}",
            "",
        )
    )


def _numbered(section: Section) -> list[tuple[int, Table]]:
    return list(enumerate(section.tables, 1))


def _write(out: Path, key: str, number: int, table: Table) -> dict[str, str]:
    name = f"{key}_{number}"
    files = {"CSV": f"{FOLDER}/{name}.csv", "LaTeX": f"{FOLDER}/{name}.tex"}
    write_whole(out / files["CSV"], to_csv(table).encode())
    write_whole(out / files["LaTeX"], to_latex(table, name).encode())
    return files


def _spread(table: Table) -> list[list[str]]:
    """Head and rows of a table whose cells have one line."""
    lines = [[cell.partition("\n") for cell in row] for row in table.rows]
    double = [any(row[k][1] for row in lines) for k in range(len(table.head))]
    beneath = [_name_of([row[k][2] for row in lines]) for k in range(len(table.head))]
    head = [(name, "", f"{name}, {second}") for name, second in zip(table.head, beneath, strict=True)]
    return [
        [text for (first, _, second), two in zip(row, double, strict=True) for text in (first, second)[: 1 + two]]
        for row in [head, *lines]
    ]


def _name_of(texts: Sequence[str]) -> str:
    """What the second lines of a column are."""
    return "interval" if any(" to " in text or text.startswith("[") for text in texts) else "note"


def _plain(text: str) -> str:
    return text.replace("−", "-")


def _latex_row(cells: Sequence[str]) -> str:
    return " & ".join(_escaped(_in_one_line(cell)) for cell in cells) + r" \\"


def _in_one_line(cell: str) -> str:
    """The second line of a cell follows the first in brackets."""
    first, _, second = cell.partition("\n")
    return f"{first} [{second.strip('[]')}]" if second else first


def _escaped(text: str) -> str:
    return "".join(LATEX.get(character, character) for character in text)
