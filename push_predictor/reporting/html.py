"""A page of plain HTML that stands alone: style and pictures are in it, and everything that is shown is escaped."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape

from push_predictor.reporting.canvas import Picture

NOTHING = "–"
STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, -apple-system, "Segoe UI", "Liberation Sans", Arial, sans-serif; color: #1c1c1c;
  background: #fff; max-width: 62rem; margin: 0 auto; padding: 1.5rem 1rem 4rem; overflow-wrap: break-word; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 0 0 .4rem; }
h2 { font-size: 1.25rem; margin: 2.4rem 0 .6rem; border-bottom: 1px solid #d8d8d8; padding-bottom: .2rem; }
p, li { max-width: 46rem; }
.lead { font-size: 1.05rem; }
.warning { border-left: 4px solid #d55e00; padding: .3rem .8rem; background: #fdf1ea; }
.table { overflow-x: auto; margin-top: .3rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .95rem; }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid #e4e4e4; vertical-align: top; }
td, tbody th { white-space: nowrap; }
thead th { border-bottom: 2px solid #888; vertical-align: bottom; font-weight: 600; }
th:first-child { text-align: left; padding-left: 0; }
.interval { color: #555; font-size: .85em; display: block; }
figure { margin: 1rem 0 1.8rem; }
img { max-width: 100%; height: auto; display: block; }
figcaption { font-size: .9rem; color: #333; max-width: 46rem; margin-top: .5rem; }
dl { display: grid; grid-template-columns: minmax(7rem, max-content) 1fr; gap: .15rem 1.2rem; }
dt { color: #555; }
dd { margin: 0; }
.finding { border-left: 4px solid #888; padding: .2rem .9rem; margin: .7rem 0; background: #f7f7f7; max-width: 46rem; }
.finding p { margin: .25rem 0; }
.verdict { font-size: .85rem; font-weight: 600; white-space: nowrap; padding: 0 .45rem; border-radius: .2rem;
  background: #6b6b6b; color: #fff; }
.finding.holds { border-color: #009e73; } .holds .verdict { background: #00704f; }
.finding.holds-in-part { border-color: #0072b2; } .holds-in-part .verdict { background: #0072b2; }
.finding.does-not-hold { border-color: #d55e00; } .does-not-hold .verdict { background: #b34700; }
.verdicts th, .verdicts td { white-space: normal; text-align: left; }
@media (max-width: 36rem) {
  dl { display: block; } dd { margin: 0 0 .4rem; }
  .picture { overflow-x: auto; } .picture img { max-width: none; width: 44rem; }
}
"""


def page(title: str, parts: Sequence[str]) -> str:
    """A whole page of parts that are HTML already."""
    body = "\n".join(parts)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        f"<h1>{escape(title)}</h1>\n{body}\n</body>\n</html>\n"
    )


def heading(text: str, anchor: str = "") -> str:
    """A section's heading; anchor: the name by which links reach it."""
    name = f' id="{escape(anchor)}"' if anchor else ""
    return f"<h2{name}>{escape(text)}</h2>"


def finding(claim: str, verdict: str, sentence: str) -> str:
    """A claim, whether it holds, and why."""
    return (
        f'<div class="finding {_mark(verdict)}"><p><strong>{escape(claim)}</strong> '
        f'<span class="verdict">{escape(verdict)}</span></p><p>{escape(sentence)}</p></div>'
    )


def verdicts(claims: str, rows: Sequence[tuple[str, str, str, str]]) -> str:
    """A table of (anchor, section, claim, verdict) that leads to the sections; claims: whose, heads their column."""
    body = "\n".join(
        f'<tr><td><a href="#{escape(anchor)}">{escape(section)}</a></td><td>{escape(claim)}</td>'
        f'<td class="{_mark(verdict)}"><span class="verdict">{escape(verdict)}</span></td></tr>'
        for anchor, section, claim, verdict in rows
    )
    head = f"<thead><tr><th>section</th><th>{escape(claims)}</th><th>here</th></tr></thead>"
    return f'<div class="table"><table class="verdicts">{head}\n<tbody>\n{body}\n</tbody></table></div>'


def _mark(verdict: str) -> str:
    return verdict.replace(" ", "-")


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph; kind is '', 'lead' or 'warning'."""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def bullets(texts: Sequence[str]) -> str:
    """A list."""
    return "<ul>\n" + "\n".join(f"<li>{escape(text)}</li>" for text in texts) + "\n</ul>"


def definitions(facts: Mapping[str, str]) -> str:
    """Names and what belongs to them."""
    rows = "\n".join(f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>" for name, text in facts.items())
    return f"<dl>\n{rows}\n</dl>"


def table(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of text; the first column names the rows, a line break in a cell sets off an interval."""
    top = "".join(f'<th scope="col">{escape(name)}</th>' for name in head)
    body = "\n".join(f'<tr><th scope="row">{escape(row[0])}</th>{"".join(map(_cell, row[1:]))}</tr>' for row in rows)
    return (
        f'<figure><figcaption>{escape(caption)}</figcaption>\n<div class="table"><table>\n'
        f"<thead><tr>{top}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table></div></figure>"
    )


def figure(picture: Picture) -> str:
    """A picture, embedded, with its caption."""
    data = base64.b64encode(picture.path.read_bytes()).decode("ascii")
    return (
        f'<figure><div class="picture"><img alt="{escape(picture.alt)}" src="data:image/png;base64,{data}"></div>\n'
        f"<figcaption>{escape(picture.caption)}</figcaption></figure>"
    )


def number(value: float | None, digits: int = 4) -> str:
    """So many significant digits, with a minus sign; a dash for what is not determined."""
    return NOTHING if value is None else f"{value:.{digits}g}".replace("-", "−")


def _cell(text: str) -> str:
    value, _, interval = text.partition("\n")
    beneath = f'<span class="interval">{escape(interval)}</span>' if interval else ""
    return f"<td>{escape(value)}{beneath}</td>"
