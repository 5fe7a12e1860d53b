# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parts that all pages share: the opening, and tables that fold."""

from __future__ import annotations

import re

import pytest

from push_predictor.reporting import html


def test_opening_has_the_sentences_the_label_and_then_the_figure() -> None:
    part = html.opening(("It <fits>.", "By 3 mm.", "Use it."), "fits", html.paragraph("figure"))
    assert re.findall(r"<p>(.*?)</p>", part) == ["It &lt;fits&gt;.", "By 3 mm.", "Use it.", "figure"]
    assert part.index("Use it.") < part.index('<span class="verdict">fits</span>') < part.index("figure")
    assert part.strip().startswith('<section class="opening">') and part.strip().endswith("</section>")
    assert "<figure" not in html.opening(("a.", "b.", "c."), "d")


def test_what_stands_in_backticks_is_code_and_still_escaped() -> None:
    assert "<p>Run <code>a &lt;b&gt;</code>, then `c.</p>" in html.paragraph("Run `a <b>`, then `c.")
    assert "<p>safe</p>" in (page := html.page("t", [html.paragraph("safe"), "<b>"])) and "&lt;b&gt;" in page
    assert "<p><code>x</code></p>" in html.answer(["`x`"], "") and "<code>y</code>" in html.finding("", "", "`y`")


@pytest.mark.parametrize(
    ("caption", "summary", "rest"),
    [
        ("Scores of pushes. Lower is better. In nats.", "Scores of pushes (2 rows)", "Lower is better. In nats."),
        ("Pushes at 0.5 m/s, e.g. fast ones.", "Pushes at 0.5 m/s, e.g. fast ones (2 rows)", ""),
        ("Coverage. 95 % intervals by push.", "Coverage (2 rows)", "95 % intervals by push."),
    ],
)
def test_folded_table_shows_the_first_sentence_until_it_is_opened(caption: str, summary: str, rest: str) -> None:
    part = html.folded_table(caption, ("model", "NMSE"), (("gp", "0.5\n[0.4, 0.6]"), ("vhgp", "0.4")))
    assert f"<summary>{summary}</summary>" in part and "<details open" not in part
    assert (f"<figcaption>{rest}</figcaption>" in part) if rest else ("figcaption" not in part)
    assert part.index("</summary>") < part.index("<table") < part.index("</table>") < part.index("</details>")
    assert '<span class="interval">[0.4, 0.6]</span>' in part


def test_folded_table_links_to_its_files() -> None:
    part = html.folded_table("Scores.", ("a", "b"), (("x", "1"),), {"CSV": "tables/t.csv", "LaTeX": "tables/t.tex"})
    assert '<a href="tables/t.csv">CSV</a> <a href="tables/t.tex">LaTeX</a>' in part
    alone = html.folded_table("Scores.", ("a", "b"), (("x", "1"),))
    assert "href" not in alone and "(1 row)" in alone


def test_summary_of_verdicts_has_a_number_for_each() -> None:
    rows = [
        html.VerdictRow("maps", "Maps", "dx is <largest>", "3.97 mm", "holds in part"),
        html.VerdictRow("noise", "Noise", "it varies", "5", "holds"),
    ]
    part = html.verdicts("claim", rows)
    assert '<div class="finding does-not-hold">' in html.finding("c", "does not hold", "s")
    assert "<th>claim</th><th>number</th><th>here</th>" in part
    assert '<td><a href="#maps">Maps</a></td><td>dx is &lt;largest&gt;</td><td>3.97 mm</td>' in part
    assert re.findall(r'<td class="([\w-]+)"><span class="verdict">(.*?)<', part) == [
        ("holds-in-part", "holds in part"),
        ("holds", "holds"),
    ]


def test_bars_show_each_count_that_is_not_zero() -> None:
    bars = [html.Bar("Claims", {"holds": 3, "not decided": 0, "too little data": 5})]
    part = html.shares(bars, "Number of verdicts.")
    found = re.findall(r'<span class="([\w-]+)" style="flex: (\d+)" title="[\w ]+">(\d+)</span>', part)
    assert found == [("holds", "3", "3"), ("too-little-data", "5", "5")]
    assert 'aria-label="Claims: holds 3 not decided 0 too little data 5"' in part
    assert part.count("<i ") == 3 and "<figcaption>Number of verdicts.</figcaption>" in part


def test_cells_name_their_column_for_narrow_screens() -> None:
    part = html.table("Scores.", ("model", "NMSE", "NLPD"), (("gp", "0.5", "-3"),))
    assert re.findall(r'data-column="(\w+)"', part) == ["NMSE", "NLPD"]
    assert '"words rows"' in part and '"words"' in html.table("", ("name", "value"), (("a", "1"),))
    page = html.page("t", [part])
    assert '<meta name="viewport" content="width=device-width, initial-scale=1">' in page
    assert "attr(data-column)" in page.split("@media (max-width: 36rem)")[1] and ".table { overflow-x: auto;" in page
