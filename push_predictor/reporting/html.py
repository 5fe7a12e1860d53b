"""A self-contained HTML page: style and pictures are inline, and every text is escaped.

The templates are in `templates/` (Jinja2). Each function returns one part of a page, marked as safe HTML
(markupsafe.Markup); `page` joins the parts.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from functools import cache
from math import isfinite
from typing import TYPE_CHECKING

from push_predictor.errors import PushPredictorError
from push_predictor.reporting.canvas import Picture
from push_predictor.reporting.chart import Chart

if TYPE_CHECKING:
    from jinja2 import Environment

NOTHING = "–"


def page(title: str, parts: Sequence[str]) -> str:
    """A whole page of parts that the functions below made; any other text is escaped.

    Raises PushPredictorError if Jinja2 is not installed, as all functions do that return a part.
    """
    return _environment().get_template("page.html").render(title=title, parts=parts) + "\n"


def heading(text: str, anchor: str = "") -> str:
    """The heading of a section; anchor is the target of links to it."""
    return _part("heading", text, anchor)


def finding(claim: str, verdict: str, sentence: str) -> str:
    """A claim, its verdict and the evidence in one sentence."""
    return _part("finding", claim, verdict, sentence)


def verdicts(claims: str, rows: Sequence[tuple[str, str, str, str]]) -> str:
    """A table of (anchor, section, claim, verdict) with links to the sections; claims heads the third column."""
    return _part("verdicts", claims, rows)


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
    """A table of text. The first column names the rows; the second line of a cell is an interval."""
    return _part("table", caption, head, [(row[0], _cells(head[1:], row[1:])) for row in rows])


def figure(picture: Picture) -> str:
    """A picture, embedded as base64, with its caption."""
    image = base64.b64encode(picture.path.read_bytes()).decode("ascii")
    return _part("figure", picture.alt, image, picture.caption)


def charts(shown: Sequence[Chart], caption: str, columns: int = 0) -> str:
    """Charts in rows of that many columns (0: as many as fit), the legend of the first, and a caption."""
    return _part("charts", shown, caption, columns, template="chart.html")


def answer(sentences: Sequence[str], verdict: str) -> str:
    """The answer of a page: the first sentence is its headline; verdict: a label of few words."""
    return _part("answer", sentences, verdict)


def details(summary: str, content: str) -> str:
    """A part that is hidden until the reader opens it."""
    return _part("details", summary, content)


def joined(parts: Sequence[str]) -> str:
    """Parts as one, for `details`."""
    return _part("joined", parts)


def number(value: float | None, digits: int = 4, zeros: bool = False) -> str:
    """A number with that many significant digits and a minus sign, a dash if unknown; zeros keeps trailing zeros."""
    if value is None or not isfinite(value):
        return NOTHING
    text = f"{value:#.{digits}g}".removesuffix(".") if zeros else f"{value:.{digits}g}"
    return text.replace("-", "−")


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
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def _part(macro: str, *arguments: object, template: str = "parts.html") -> str:
    module = _environment().get_template(template).module
    part: str = getattr(module, macro)(*arguments)
    return part
