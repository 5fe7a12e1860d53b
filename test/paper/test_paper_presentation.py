# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How the report is shown: counts of verdicts, grey ones, places in the paper, tables as files."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from push_predictor_paper.plan import FULL, QUICK, Plan
from push_predictor_paper.presentation.enough import too_little
from push_predictor_paper.presentation.places import PLACES
from push_predictor_paper.presentation.summary import TOO_LITTLE, counts, opening_sentences
from push_predictor_paper.presentation.table_files import to_csv, to_latex, write_tables
from push_predictor_paper.report import CLAIMS
from push_predictor_paper.section import Finding, Section, Table

OURS = "beyond the paper"
SECTIONS = (
    Section("maps", "Maps", (Finding("a", "holds", "1"), Finding("b", "does not hold", "2"))),
    Section("comparison", "Models", (Finding("c", "holds", "3"), Finding("d", "holds in part", "4", OURS))),
    Section("modality", "Modes", (Finding("e", "not decided", "5"),)),
)
TABLE = Table(
    "NLPD of 5 % & more. By push.",
    ("model_a, split", "NLPD", "p < 0.05", "count"),
    (("gp", "−0.51\n−0.60 to −0.42", "1 %\np = 0.03", "7"), ("vhgp", "0.40\n0.30 to 0.50", "2 %", "8")),
)


# --- verdicts --------------------------------------------------------------------------------------------------------


def test_verdicts_are_counted_by_origin_and_those_without_enough_data_apart() -> None:
    assert list(counts(SECTIONS, "paper", {}).values()) == [2, 0, 1, 1, 0]
    assert counts(SECTIONS, OURS, {}) == {
        "holds": 0, "holds in part": 1, "does not hold": 0, "not decided": 0, TOO_LITTLE: 0,
    }  # fmt: skip
    assert list(counts(SECTIONS, "paper", {"maps": "few"}).values()) == [1, 0, 0, 1, 2]


def study(*measured: str) -> Any:
    """As much of a study as the opening asks for."""
    corpora = tuple(SimpleNamespace(name=name) for name in measured)
    return SimpleNamespace(simulated=SimpleNamespace(sets=range(16)), measured=corpora)


@pytest.mark.parametrize("lacking", [{}, {"maps": "few"}])
def test_opening_has_three_plain_sentences(lacking: dict[str, str]) -> None:
    for sentence in opening_sentences(SECTIONS, study("measured: mit_square"), lacking):
        assert sentence.endswith(".") and len(sentence.split()) <= 26, sentence


# --- enough data -----------------------------------------------------------------------------------------------------


def test_the_full_plan_has_enough_data_for_every_claim() -> None:
    assert too_little(FULL) == {}


def test_the_quick_plan_has_enough_data_for_few_claims() -> None:
    lacking = too_little(QUICK)
    assert {*CLAIMS_BY_KEY} - {*lacking} == {"comparison", "calibration"}


CLAIMS_BY_KEY = [name.replace(" ", "_").replace("-", "_") for name in CLAIMS]


@pytest.mark.parametrize(
    ("plan", "section", "lacks"),
    [
        (replace(FULL, repetitions=31, other_repetitions=31), "noise", False),
        (replace(FULL, repetitions=100, other_repetitions=30), "noise", True),
        (replace(FULL, sizes=(10, 999)), "learning_curves", True),
        (replace(FULL, sizes=(10, 1000)), "learning_curves", False),
        (replace(FULL, surfaces=FULL.surfaces[:3]), "data", True),
        (replace(FULL, speeds=(0.01, 0.4)), "speed_error", True),
        (replace(FULL, speed_pushes=49), "quasi_static", True),
        (replace(FULL, speed_pushes=50), "quasi_static", False),
    ],
)
def test_each_requirement_has_its_bound(plan: Plan, section: str, lacks: bool) -> None:
    assert (section in too_little(plan)) is lacks


# --- places in the paper ---------------------------------------------------------------------------------------------


def test_only_questions_beyond_the_paper_have_no_place_in_it() -> None:
    assert {*CLAIMS_BY_KEY} - {*PLACES} == {"calibration"} and {*PLACES} <= {*CLAIMS_BY_KEY}
    named = " ".join(PLACES.values())
    assert {*re.findall(r"\d+", named)} == {"1", "5", "6", "7", "8", "9", "10", "11"}
    assert "table I" in named and "table II" in named


# --- tables as files -------------------------------------------------------------------------------------------------


def test_csv_has_every_cell_and_intervals_in_columns_of_their_own() -> None:
    head, *rows = csv.reader(io.StringIO(to_csv(TABLE)))
    assert head == ["model_a, split", "NLPD", "NLPD, interval", "p < 0.05", "p < 0.05, note", "count"]
    assert rows == [["gp", "-0.51", "-0.60 to -0.42", "1 %", "p = 0.03", "7"],
                    ["vhgp", "0.40", "0.30 to 0.50", "2 %", "", "8"]]  # fmt: skip
    assert float(rows[0][1]) == -0.51


def test_latex_has_every_cell_and_escapes_what_latex_would_read() -> None:
    text = to_latex(TABLE, "noise_1")
    assert r"\caption{NLPD of 5 \% \& more. By push.}" in text and r"\label{tab:noise_1}" in text
    assert r"\begin{tabular}{lrrr}" in text
    assert r"model\_a, split & NLPD & p $<$ 0.05 & count \\" in text
    assert r"gp & $-$0.51 [$-$0.60 to $-$0.42] & 1 \% [p = 0.03] & 7 \\" in text
    assert r"vhgp & 0.40 [0.30 to 0.50] & 2 \% & 8 \\" in text
    assert text.index(r"\toprule") < text.index("model") < text.index(r"\midrule") < text.index("gp")
    assert text.index("vhgp") < text.index(r"\bottomrule") and text.isascii()


def test_every_table_of_every_section_is_written(tmp_path: Path) -> None:
    sections = [Section("maps", "Maps", (), (TABLE, replace(TABLE, caption="Second."))), Section("noise", "Noise", ())]
    files = write_tables(tmp_path, sections)
    assert files == {
        "maps": [{"CSV": f"tables/maps_{n}.csv", "LaTeX": f"tables/maps_{n}.tex"} for n in (1, 2)],
        "noise": [],
    }
    assert (tmp_path / "tables" / "maps_1.csv").read_text() == to_csv(TABLE)
    assert (tmp_path / "tables" / "maps_2.tex").read_text().count(r"\caption{Second.}") == 1
    assert len(list((tmp_path / "tables").iterdir())) == 4
