# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rule of the verdicts, the range that each claim requires, and tables as text, CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import re

import numpy as np
import pytest
from paper_studies import verdict_on
from push_predictor_paper.claims import CLAIMS
from push_predictor_paper.estimate import exactly, of_ends, over_seeds
from push_predictor_paper.report import OF_CORPUS, OF_STUDY, TITLES
from push_predictor_paper.section import Number, Table
from push_predictor_paper.statistics.modes import count_with_modes
from push_predictor_paper.verdict import Bound, Claim, Evidence, Figure, judged, verdict_of

from push_predictor.evaluation.estimate import Estimate

WITHIN, WIDER = Bound(0.0, 1.0), Bound(0.0, 2.0)


@pytest.mark.parametrize(
    ("intervals", "verdict", "with_wider"),
    [
        ([(0.1, 0.9), (0.0, 1.0)], "holds", "holds"),
        ([(0.1, 0.9), (5.0, 6.0)], "holds in part", "holds in part"),
        ([(0.5, 1.5), (5.0, 6.0)], "does not hold", "holds in part"),
        ([(1.1, 2.5), (0.5, 3.0)], "does not hold", "not decided"),
        ([(-2.0, -1.0), (0.5, 3.0)], "does not hold", "does not hold"),
        ([(0.5, 1.5), (-1.0, 0.5)], "not decided", "holds in part"),
        ([(np.nan, np.nan)], "not decided", "not decided"),
        ([], "not decided", "not decided"),
    ],
)
def test_one_rule_decides(intervals: list[tuple[float, float]], verdict: str, with_wider: str) -> None:
    figures = [Estimate(low, low, high) for low, high in intervals]
    assert verdict_of([(figure, WITHIN, None) for figure in figures]) == verdict
    assert verdict_of([(figure, WITHIN, WIDER) for figure in figures]) == with_wider


def test_strict_range_has_no_ends() -> None:
    assert Bound(high=0.0).contains(exactly(0.0)) and not Bound(high=0.0, strict=True).contains(exactly(0.0))
    assert verdict_of([(exactly(0.0), Bound(low=0.0, strict=True), None)]) == "not decided"


@pytest.mark.parametrize(
    ("bound", "text"),
    [
        (Bound(low=0.9), "at least 90%"),
        (Bound(high=0.5), "at most 50%"),
        (Bound(0.1, 0.4), "10% to 40%"),
        (Bound(high=0.0, strict=True), "below 0"),
        (Bound(low=-0.1, strict=True), "above −10%"),
    ],
)
def test_range_in_words(bound: Bound, text: str) -> None:
    assert bound.text(".0%") == text


def test_finding_has_figures_ranges_and_the_paper_s_number() -> None:
    claim = Claim("It is short", "figure 1", "Length", WITHIN, WIDER, ".1f", "m", "0.5 m")
    own = Figure("b", exactly(7.0), Bound(low=3.0))
    found = judged(claim, Evidence([Figure("a", Estimate(1.0, 0.9, 1.1)), own], "More."), "simulated")
    assert (found.claim, found.verdict, found.number) == (
        "It is short (simulated)", "holds in part", "a 1.0 (0.9 to 1.1) m; b 7.0 m",
    )  # fmt: skip
    assert found.sentence == (
        "Length: a 1.0 (0.9 to 1.1) m; b 7.0 m. Required: a 0 to 1.0 m (in part: 0 to 2.0 m); b at least 3.0 m. "
        "The paper: 0.5 m. More."
    )
    assert found.json()["figures"][1] == {"name": "b", "value": 7.0, "low": 7.0, "high": 7.0}


FITS = {  # of each claim: figures with which it holds, with which it does not
    "data": {"sets": (16, 15), "known": (0.95, 0.4)},
    "kinds_of_push": {"growth": (0.9, 1.1), "apart": (2.1, 0.9), "modes": (1, 0)},
    "maps": {
        "forward": (0.95, 0.85), "sideways": (0.95, 0.7), "turning": (0.95, 0.85), "handedness": (0.1, -0.1),
        "mean_map": (0.95, 0.85), "sd_map": (0.55, 0.45),
    },
    "noise": {"size": (0.11, 0.09), "span": (3.3, 33.0), "shape": (0.75, 0.25)},
    "learning_curves": {"circle": (0.1, -0.1), "surface": (0.45, 1.1), "saturation": (0.09, 0.11)},
    "comparison": {
        "early": (149, 151), "better": (-0.1, 0.1), "similar": (0.91, 1.25), "density": (-0.1, 0.1),
        "mean_gain": (-0.1, 0.1),
    },
    "speed_error": {"unreliable": (0.11, 0.09), "captured": (-0.1, 0.1)},
    "divergence": {"mean": (-0.1, 0.1), "median": (-0.1, 0.1), "good": (0.9, 2.5)},
    "modality": {"modes": (1, 0), "not_gaussian": (1, 0), "gaussian_good": (0.15, 0.33)},
    "quasi_static": {"course": (0.1, -0.1), "turn": (50, 81), "beyond": (0.11, 0.09), "speed_input": (-0.1, 0.1)},
}  # fmt: skip


@pytest.mark.parametrize(("section", "claim"), [(s, c) for s, claims in CLAIMS.items() for c in claims])
def test_each_claim_requires_its_range(section: str, claim: str) -> None:
    good, bad = FITS[section][claim]
    assert verdict_on(section, claim, Evidence([Figure("", exactly(good))])) == "holds"
    assert verdict_on(section, claim, Evidence([Figure("", exactly(bad))])) == "does not hold"


@pytest.mark.parametrize(
    ("section", "claim", "value"),
    [("data", "known", 0.7), ("kinds_of_push", "apart", 1.5), ("maps", "sideways", 0.8), ("noise", "shape", 0.5),
     ("learning_curves", "surface", 0.7), ("comparison", "similar", 0.85), ("divergence", "good", 2.0),
     ("modality", "gaussian_good", 0.3)],
)  # fmt: skip
def test_wider_range_makes_a_claim_hold_in_part(section: str, claim: str, value: float) -> None:
    assert verdict_on(section, claim, Evidence([Figure("", exactly(value))])) == "holds in part"


def test_claims_name_every_figure_and_table_of_results_in_the_paper() -> None:
    places = " ".join(claim.place for claims in CLAIMS.values() for claim in claims.values())
    assert {*re.findall(r"\d+", places)} == {"1", "5", "6", "7", "8", "9", "10", "11"}
    assert "table I" in places and "table II" in places
    assert [*TITLES] == [*CLAIMS] and {*OF_STUDY} | {*OF_CORPUS} == {*CLAIMS}


def test_finding_no_modes_is_evidence_only_where_they_would_have_been_found() -> None:
    assert Bound(low=1.0).excludes(count_with_modes(0, 0.8)) and not Bound(low=1.0).excludes(count_with_modes(0, 0.79))
    assert Bound(low=1.0).contains(count_with_modes(1, 0.0))


def test_table_as_text_csv_and_json() -> None:
    rows = (("gp", Number(Estimate(-0.514, -0.6, -0.42)), 7), ("vhgp", Number(Estimate(0.4, np.nan, np.nan)), 8))
    table = Table("NLPD by push.", ("model", "NLPD", "count"), rows)
    assert table.texts == [["gp", "−0.51\n−0.60 to −0.42", "7"], ["vhgp", "0.40\n– to –", "8"]]
    head, *lines = csv.reader(io.StringIO(table.csv()))
    assert head == ["model", "NLPD", "NLPD, interval", "count"]
    assert lines == [["gp", "-0.51", "-0.60 to -0.42", "7"], ["vhgp", "0.40", "– to –", "8"]]
    content = json.loads(json.dumps(table.json(), allow_nan=False))
    assert content["rows"][0] == {"model": "gp", "NLPD": {"value": -0.514, "low": -0.6, "high": -0.42}, "count": 7}


def test_estimates_over_seeds_and_of_several() -> None:
    assert over_seeds([1.0, 2.0, 3.0]).text(".3f") == "2.000 (−0.484 to 4.484)"  # Student's interval
    assert np.isnan(over_seeds([1.0]).low)
    parts = [Estimate(1.0, 0.5, 4.0), Estimate(2.0, 0.1, 3.0)]
    assert of_ends(np.min, parts) == Estimate(1.0, 0.1, 3.0) and of_ends(np.max, parts) == Estimate(2.0, 0.5, 4.0)
