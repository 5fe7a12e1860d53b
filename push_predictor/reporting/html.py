# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A self-contained HTML page: style and pictures are inline, and every text is escaped.

The templates are in `templates/` (Jinja2). Each function returns one part of a page, marked as safe HTML
(markupsafe.Markup); `page` joins the parts.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import isfinite
from typing import TYPE_CHECKING

from push_predictor.errors import PushPredictorError
from push_predictor.reporting.canvas import Picture
from push_predictor.reporting.chart import Chart

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

NOTHING = "–"
CODE = re.compile(r"`([^`]+)`")
SENTENCE_END = re.compile(r"(?<=\.) (?=[A-Z\d])")


def page(title: str, parts: Sequence[str]) -> str:
    """A whole page of parts that the functions below made; any other text is escaped.

    Raises PushPredictorError if Jinja2 is not installed, as all functions do that return a part.
    """
    return _environment().get_template("page.html").render(title=title, parts=parts) + "\n"


def heading(text: str, anchor: str = "") -> str:
    """The heading of a section; anchor is the target of links to it."""
    return _part("heading", text, anchor)


@dataclass(frozen=True)
class VerdictRow:
    """A row of `verdicts`: anchor and title of a section, a claim, its number and verdict."""

    anchor: str
    section: str
    claim: str
    number: str
    verdict: str


@dataclass(frozen=True)
class Bar:
    """A bar of `shares`: its title, and how many of each kind, by name; kinds without any are not drawn."""

    title: str
    counts: Mapping[str, int]


def finding(claim: str, verdict: str, sentence: str) -> str:
    """A claim, its verdict and the evidence in few sentences."""
    return _part("finding", claim, verdict, sentence)


def verdicts(claims: str, rows: Sequence[VerdictRow]) -> str:
    """A table of claims with their numbers, verdicts and links to the sections; claims heads the second column."""
    return _part("verdicts", claims, rows)


def shares(bars: Sequence[Bar], caption: str) -> str:
    """Bars divided by counts of verdicts, with their legend, and a caption."""
    return _part("shares", bars, caption)


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph; kind is '', 'lead' or 'warning'."""
    return _part("paragraph", text, kind)


def bullets(texts: Sequence[str]) -> str:
    """A bulleted list."""
    return _part("bullets", texts)


def definitions(facts: Mapping[str, str]) -> str:
    """A list of names with their values."""
    return _part("definitions", facts)


def table(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of text. The first column names the rows; the second line of a cell is an interval.

    On a narrow screen each row becomes a list of its columns.
    """
    return _part("table", caption, head, [(row[0], _cells(head[1:], row[1:])) for row in rows])


def folded_table(
    caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], files: Mapping[str, str] | None = None
) -> str:
    """A table that is hidden until the reader opens it under the first sentence of its caption.

    files: addresses of the same table in other formats, by the name of the format.
    """
    first, rest = _first_sentence(caption)
    summary = f"{first.removesuffix('.')} ({count(len(rows), 'row', 'rows')})"
    return _part("folded_table", summary, table(rest, head, rows), files or {})


def figure(picture: Picture) -> str:
    """A picture, embedded as base64, with its caption."""
    image = base64.b64encode(picture.path.read_bytes()).decode("ascii")
    return _part("figure", picture.alt, image, picture.caption)


def charts(shown: Sequence[Chart], caption: str, columns: int = 0) -> str:
    """Charts in rows of that many columns (0: as many as fit), the legend of the first, and a caption."""
    return _part("charts", shown, caption, columns, template="chart.html")


def opening(sentences: tuple[str, str, str], verdict: str, figure: str = "") -> str:
    """The opening of every page: what was found, how sure or how large, what to do; a label; and one figure."""
    return _part("opening", answer(sentences, verdict), figure)


def answer(sentences: Sequence[str], verdict: str) -> str:
    """The answer of a page: the first sentence is its headline; verdict: a label of few words."""
    return _part("answer", sentences, verdict)


def joined(parts: Sequence[str]) -> str:
    """Parts as one, for `details`."""
    return _part("joined", parts)


def number(value: float | None, digits: int = 4, zeros: bool = False) -> str:
    """A number with that many significant digits and a minus sign, a dash if unknown; zeros keeps trailing zeros."""
    if value is None or not isfinite(value):
        return NOTHING
    text = f"{value:#.{digits}g}".removesuffix(".") if zeros else f"{value:.{digits}g}"
    return text.replace("-", "−")


def count(n: int, one: str, many: str) -> str:
    """A number of things."""
    return f"{n} {one if n == 1 else many}"


def _first_sentence(text: str) -> tuple[str, str]:
    """The first sentence of a text, and the rest."""
    first, *rest = SENTENCE_END.split(text, maxsplit=1)
    return first, "".join(rest)


def _cells(head: Sequence[str], row: Sequence[str]) -> list[tuple[str, str, str]]:
    """Head of the column, value and interval of each cell."""
    split = (cell.partition("\n") for cell in row)
    return [(name, value, interval) for name, (value, _, interval) in zip(head, split, strict=True)]


def check_installed(option: str) -> None:
    """Raise PushPredictorError that names the option unless pages can be made.

    Called before the work, so that minutes of it are not lost at the end.
    """
    try:
        _environment()
    except PushPredictorError as error:
        raise PushPredictorError(f"{option}: {error}") from None


@cache
def _environment() -> Environment:
    try:
        from jinja2 import Environment, PackageLoader, StrictUndefined
    except ImportError as error:
        raise PushPredictorError(f"pages need Jinja2 ({error}); pip install 'push_predictor[report]'") from None
    loader = PackageLoader("push_predictor.reporting")
    made = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    made.filters["code"] = _code
    return made


def _code(text: str) -> Markup:
    """A text in which what stands in backticks is code."""
    from markupsafe import Markup, escape

    return Markup(CODE.sub(r"<code>\1</code>", str(escape(text))))


def _part(macro: str, *arguments: object, template: str = "parts.html") -> str:
    module = _environment().get_template(template).module
    part: str = getattr(module, macro)(*arguments)
    return part
