# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The comparison of models, the crossing point and the gain in the mean: made-up scores whose truth is known."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from paper_studies import PLAN, made_up_corpus, made_up_study, verdict_on
from push_predictor_paper.claims import CLAIMS
from push_predictor_paper.fits.crossing import Crossing, below_zero_from, crossing
from push_predictor_paper.fits.curves import Curves
from push_predictor_paper.fits.fit import SPLITS, Fit, Score
from push_predictor_paper.sections.comparison import _paper_table, comparison_evidence, crossings_of, improves, section

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.push_scores import PushScores

CORPUS = made_up_corpus()
SIZES = (10, 100, 1000)


def push_scores(
    nmse: float, nlpd: float = 0.0, exact: float | None = None, noise: float = 0.01, fold: int = 0
) -> PushScores:
    """40 pushes of about these totals."""
    rng = np.random.default_rng(fold)
    one = np.ones((40, 3))
    error = one * nmse / 3 * (1.0 + noise * rng.standard_normal((40, 1)))
    nats, precise = (one * v / 3 for v in (nlpd, nlpd if exact is None else exact))
    names = np.array([f"{fold}-{k}" for k in range(40)])
    return PushScores(names, np.ones(40), error, one, nats, precise, np.ones((40, 3, 3)))


def curves_of(**kinds) -> Curves:
    """Curves on the reference pair: by kind, the arguments of `push_scores` at each size, in five folds."""
    return Curves(
        {
            (CORPUS.reference, kind, split, n): tuple(
                Score(Fit(kind, n, split, k), push_scores(**arguments, fold=k), np.zeros((40, 3))) for k in range(5)
            )
            for kind, by_size in kinds.items()
            for n, arguments in zip(SIZES, by_size, strict=True)
            for split in SPLITS
        }
    )


def levels(*nmse: float) -> list[dict[str, float]]:
    return [{"nmse": value} for value in nmse]


ALIKE = curves_of(analytical=levels(1, 1, 1), gp=levels(1, 1, 1), vhgp=levels(1, 1, 1))


def verdicts(found: Curves) -> dict[str, str]:
    """The verdicts at the largest size, whole pushes held out."""
    where = crossings_of(CORPUS, found, dict.fromkeys(SPLITS, SIZES))["push"]
    evidence = comparison_evidence(CORPUS, found, where, 1000)
    return {key: verdict_on("comparison", key, value) for key, value in evidence.items()}


def test_a_crossing_lies_on_the_straight_line_in_log_n():
    sizes = below_zero_from((10, 100, 1000), np.array([[1.0, 1.0, -1.0], [-0.5, -1.0, -1.0], [1.0, 0.5, 0.1]]))
    assert sizes == pytest.approx([10**2.5, 10.0, np.inf])


def test_a_gap_must_stay_below_zero_from_there_on():
    gaps = np.array([[1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 0.0], [1.0, -1.0, -1.0]])
    assert below_zero_from((10, 100, 1000), gaps) == pytest.approx([np.inf, 10**2.5, np.inf, 10**1.5])


def test_the_crossing_of_two_known_curves():
    learned, flat = (
        [[push_scores(v, fold=k) for k in range(5)] for v in (1.1, 0.7, 0.3)],
        [[push_scores(0.9, fold=k) for k in range(5)]] * 3,
    )
    found = crossing(SIZES, learned, flat)
    assert found.value == pytest.approx(10**1.5, rel=0.01)
    assert found.low <= found.value <= found.high and found.high < 1.1 * found.low


def test_noise_from_push_to_push_widens_the_interval():
    flat = [[push_scores(0.9, noise=0.0, fold=k) for k in range(5)]] * 3
    wide, narrow = (
        crossing(SIZES, [[push_scores(v, noise=noise, fold=k) for k in range(5)] for v in (1.1, 0.7, 0.3)], flat)
        for noise in (1.0, 0.01)
    )
    assert wide.high / wide.low > 1.5 * narrow.high / narrow.low


def test_crossing_text_names_the_smallest_and_largest_size():
    assert Crossing(10.0, 10.0, np.inf, 10, 1000).text() == "at most 10 (at most 10 to beyond 1000)"
    beyond = Crossing(np.inf, np.inf, np.inf, 10, 140).estimate()
    assert (beyond.low, beyond.high) == (140, np.inf)


def dense(nlpd: float, exact: float | None = None) -> list[dict[str, float | None]]:
    return [{"nmse": 0.4, "nlpd": nlpd, "exact": exact}] * 3


@pytest.mark.parametrize(
    ("claim", "gp", "vhgp", "verdict"),
    [
        # both cross 0.7, with their intervals, before 150 windows
        ("early", levels(1.0, 0.5, 0.2), levels(1.0, 0.5, 0.2), "holds"),
        ("early", levels(1.0, 0.9, 0.2), levels(1.0, 0.9, 0.8), "does not hold"),
        ("early", levels(1.0, 0.5, 0.2), levels(1.0, 0.9, 0.2), "holds in part"),
        # in the end both have a smaller error than 0.7
        ("better", levels(1, 1, 0.4), levels(1, 1, 0.4), "holds"),
        ("better", levels(1, 1, 0.9), levels(1, 1, 0.9), "does not hold"),
        ("better", levels(1, 1, 0.4), levels(1, 1, 0.9), "holds in part"),
        # their errors differ by at most a tenth
        ("similar", levels(1, 1, 0.4), levels(1, 1, 0.41), "holds"),
        ("similar", levels(1, 1, 0.4), levels(1, 1, 0.442), "holds in part"),
        ("similar", levels(1, 1, 0.4), levels(1, 1, 0.2), "does not hold"),
        # the VHGP's NLPD is the smaller one, of the Gaussian and exact
        ("density", dense(-3.0), dense(-4.0, -4.1), "holds"),
        ("density", dense(-3.0), dense(-3.0, -3.0), "not decided"),
        ("density", dense(-3.0), dense(-3.0, -3.2), "holds in part"),
        ("density", dense(-3.0), dense(-2.0, -2.0), "does not hold"),
    ],
)
def test_the_verdict_on_scores_of_this_size(claim, gp, vhgp, verdict):
    assert verdicts(curves_of(analytical=levels(0.7, 0.7, 0.7), gp=gp, vhgp=vhgp))[claim] == verdict


def test_sizes_that_end_before_150_decide_nothing():
    at = Crossing(np.inf, np.inf, np.inf, 10, 140)
    evidence = comparison_evidence(CORPUS, ALIKE, {"gp": at, "vhgp": at}, 1000)["early"]
    assert verdict_on("comparison", "early", evidence) == "not decided"


def gains(*signs: int) -> dict[int, Estimate]:
    """Better (-1), worse (1) or neither (0) at each size."""
    return {n: Estimate(0.1 * s, 0.1 * s - 0.05, 0.1 * s + 0.05) for n, s in zip(SIZES, signs, strict=True)}


@pytest.mark.parametrize(
    ("signs", "verdict"), [((1, 0, -1), "holds"), ((-1, 0, 1), "does not hold"), ((-1, 1, 0), "not decided")]
)
def test_the_largest_size_alone_decides_whether_the_mean_improves(signs, verdict):
    assert verdict_on("comparison", "mean_gain", improves(gains(*signs))) == verdict


def test_mean_gain_names_sizes_with_better_and_worse_intervals():
    assert "below 0 at n = 100, above at 10 " in improves(gains(1, -1, 0)).note


@pytest.mark.long
def test_section_compares_all_three_kinds_with_the_paper(tmp_path):
    corpus = made_up_corpus(speeds=(0.02, 0.1))  # fast pushes take the analytical model long
    compared = section(replace(made_up_study(tmp_path, replace(PLAN, sizes=(20,))), simulated=corpus), corpus)
    paper = next(table for table in compared.tables if "paper" in table.head[1])
    assert paper.rows[0][1:4] == ("0.72", "0.38", "0.37")
    assert set(compared.evidence) == set(CLAIMS["comparison"])
    assert all(picture.path.exists() for picture in compared.pictures)
    json.dumps([table.json() for table in compared.tables], allow_nan=False)


def test_the_paper_s_units_add_13_8155_to_the_nlpd():
    found = curves_of(**{kind: [{"nmse": 1.0, "nlpd": -4.0}] * 3 for kind in ("analytical", "gp", "vhgp")})
    _, nlpd = _paper_table(CORPUS, found, 1000).rows
    assert [number.estimate.value for number in nlpd[4:]] == pytest.approx([13.8155 - 4.0] * 3, abs=1e-4)
