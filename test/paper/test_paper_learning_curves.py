# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The section on learning curves: made-up scores whose truth is known, and the whole section on a small study."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from paper_studies import made_up_corpus, made_up_study, rig_of, verdict_on
from push_predictor_paper.data.corpus import Corpus, PushSet
from push_predictor_paper.fits.curves import Curves, gathered
from push_predictor_paper.fits.fit import SPLITS, Fit, Score, random_split
from push_predictor_paper.sections.learning_curves import band_or_range, circle, saturation, section, surface

from push_predictor.evaluation.estimate import total_nmse
from push_predictor.evaluation.push_scores import PushScores

SHAPES, SURFACES = ("rect1", "ellip1", "ellip2"), ("plywood", "abs", "pu")
TABLE = made_up_corpus().sets["rect1", "plywood"].table
CORPUS = Corpus(
    "simulated",
    "made up",
    {(s, u): PushSet(TABLE, rig_of(s, u)) for s in SHAPES for u in SURFACES},
    ("rect1", "plywood"),
)


def score(fit: Fit, nmse: float, nlpd: float) -> Score:
    """A score of 6 pushes with these totals."""
    one = np.ones((6, 3))
    push_scores = PushScores(
        np.array(list("abcdef")), np.ones(6), one * nmse / 3, one, one * nlpd / 3, one * nlpd / 3, np.ones((6, 3, 3))
    )
    return Score(fit, push_scores, np.zeros((6, 3)))


def made_up(nmse, nlpd=lambda shape, surface, n: -10.0, sizes=(500, 1000), noise=0.01) -> Curves:
    """Curves of the VHGP by formulas of (shape, surface, n), with a little noise from fold to fold."""
    rng = np.random.default_rng(0)
    cells = {}
    for shape, material in CORPUS.sets:
        for split in SPLITS:
            for n in sizes:
                level, nats = nmse(shape, material, n), nlpd(shape, material, n)
                cells[(shape, material), "vhgp", split, n] = tuple(
                    score(Fit("vhgp", n, split, k), level * (1.0 + noise * rng.standard_normal()), nats + noise * k)
                    for k in range(5)
                )
    return Curves(cells)


PAIRS = tuple(CORPUS.sets)


def round_is(factor: float, nats: float, noise: float = 0.01):
    """The circle's NMSE is that many times the others', its NLPD so much more."""
    return made_up(
        lambda shape, _, n: 0.3 * (factor if shape == "ellip1" else 1.0),
        lambda shape, _, n: -10.0 + (nats if shape == "ellip1" else 0.0),
        noise=noise,
    )


@pytest.mark.parametrize(
    ("factor", "nats", "verdict"),
    [(0.5, -1.0, "holds"), (2.0, 1.0, "does not hold"), (0.5, 1.0, "holds in part"), (1.0, 0.0, "not decided")],
)
def test_the_circle_is_easiest_if_every_other_shape_is_harder_in_both_figures(factor, nats, verdict):
    assert verdict_on("learning_curves", "circle", circle(round_is(factor, nats), PAIRS)) == verdict


def test_folds_of_one_set_do_not_count_as_sets():
    """One surface among three gives the whole gap: five folds of each do not make that sure."""
    one = made_up(lambda shape, u, n: 0.3 - (0.29 if (shape, u) == ("ellip1", "pu") else 0.0), noise=0.001)
    assert verdict_on("learning_curves", "circle", circle(one, PAIRS)) == "not decided"


def spread(surfaces: float, shapes: float) -> Curves:
    """NMSE and NLPD that differ by so much from surface to surface and from shape to shape."""

    def level(shape: str, material: str, _: int) -> float:
        return 1.0 + surfaces * SURFACES.index(material) + shapes * SHAPES.index(shape)

    return made_up(level, level)


@pytest.mark.parametrize(
    ("surfaces", "shapes", "verdict"),
    [(0.02, 0.3, "holds"), (0.3, 0.02, "does not hold"), (0.2, 0.3, "holds in part")],
)
def test_the_surface_matters_little_if_shapes_differ_far_more(surfaces, shapes, verdict):
    assert verdict_on("learning_curves", "surface", surface(spread(surfaces, shapes), PAIRS)) == verdict


def falling(per_doubling: float, nats: float, sizes=(500, 1000)) -> Curves:
    """Each doubling takes that share of the NMSE and so many nats."""
    return made_up(
        lambda s, u, n: (1.0 - per_doubling) ** np.log2(n / 500), lambda s, u, n: -nats * np.log2(n / 500), sizes, 0.001
    )


@pytest.mark.parametrize(
    ("share", "nats", "verdict"), [(0.02, 0.01, "holds"), (0.3, 0.5, "does not hold"), (0.02, 0.5, "holds in part")]
)
def test_saturated_means_that_a_doubling_gains_next_to_nothing(share, nats, verdict):
    assert verdict_on("learning_curves", "saturation", saturation(falling(share, nats), PAIRS)) == verdict


@pytest.mark.parametrize(
    ("claim", "evidence"),
    [
        ("circle", circle(round_is(0.5, -1.0), [pair for pair in PAIRS if pair[0] != "ellip1"])),
        ("surface", surface(spread(0.1, 0.1), [pair for pair in PAIRS if pair[1] == "abs"])),
        ("saturation", saturation(falling(0.3, 0.5, (100, 200)), PAIRS)),
        ("saturation", saturation(falling(0.3, 0.5, (100,)), PAIRS)),
    ],
    ids=["no circle", "one surface", "an early end", "one size"],
)
def test_without_what_a_claim_compares_nothing_is_decided(claim, evidence):
    assert verdict_on("learning_curves", claim, evidence) == "not decided"


def test_the_gain_of_one_set_has_an_interval_by_push():
    found = saturation(falling(0.02, 0.01), PAIRS[:1])
    assert verdict_on("learning_curves", "saturation", found) == "holds"
    assert "one set, interval by push" in found.note


def test_interval_of_the_gain_reflects_differences_between_sets():
    def level(shape: str, u: str, n: int) -> float:
        return 0.3 if n == 500 else 0.3 * (1.0 - (0.3 if (shape, u) == ("rect1", "pu") else 0.0))

    gain = saturation(made_up(level, lambda s, u, n: 0.5 * (n == 500), noise=0.0), PAIRS).figures[0].estimate
    assert (gain.low, gain.high) == pytest.approx((-0.044, 0.110), abs=1e-3)  # t of 9 sets, by hand: 3.33 +- 7.69 %


def test_gain_is_per_doubling_for_any_ratio_of_sizes():
    assert saturation(falling(0.3, 0.5, (100, 800)), PAIRS).figures[0].estimate.value == pytest.approx(0.3, abs=1e-3)


def test_difference_to_each_shape():
    figures = {figure.name: figure.estimate.value for figure in circle(round_is(0.5, -1.0, noise=0.0), PAIRS).figures}
    assert figures["square NMSE"] == pytest.approx(0.15) and len(figures) == 4


def test_a_size_that_a_fold_is_too_small_for_is_not_shown():
    pair = ("rect1", "plywood")
    fits = [(pair, Fit("vhgp", n, "push", k)) for n in (10, 20) for k in (0, 1)]
    found = gathered(fits, {key: score(key[1], 0.3, 0.0) for key in fits[:3]})
    assert found.sizes([pair], "vhgp", "push") == (10,)


def test_the_mean_over_pairs_is_taken_seed_by_seed():
    a, b = ("rect1", "abs"), ("ellip1", "abs")
    cells = {
        (pair, "vhgp", "push", 10): tuple(score(Fit("vhgp", 10, "push", k), level + k, 0.0) for k in (0, 1))
        for pair, level in ((a, 1.0), (b, 2.0))
    }
    assert Curves(cells).values([a, b], "vhgp", "push", 10, total_nmse) == pytest.approx([1.5, 2.5])


def test_two_folds_show_their_range_and_three_an_interval():
    two, three = band_or_range([0.2, 0.4]), band_or_range([0.2, 0.3, 0.4])
    assert (two.value, two.low, two.high) == pytest.approx((0.3, 0.2, 0.4))
    assert three.high == pytest.approx(0.3 + 4.303 * 0.1 / np.sqrt(3), abs=1e-3)


@pytest.mark.long
def test_a_measured_set_of_one_pair_gets_tables_of_its_own(tmp_path):
    study = made_up_study(tmp_path)
    reference = study.simulated.reference
    measured = Corpus("measured", "measured: one", {reference: study.simulated.sets[reference]}, reference)
    made = section(replace(study, measured=(measured,)), measured)
    assert len(made.tables[0].rows) == 1 and [picture.path.exists() for picture in made.pictures] == [True]
    assert [made.evidence[claim].figures for claim in ("circle", "surface")] == [(), ()]


@pytest.mark.parametrize("rows, tested", [(3500, 1000), (100, 30)])
def test_random_split_tests_the_same_rows_for_every_seed(rows: int, tested: int) -> None:
    order = np.random.default_rng(0).permutation(rows)
    for seed in range(3):
        split = random_split(rows, seed)
        assert split.test.tolist() == order[:tested].tolist()
        drawn = order[tested:][np.random.default_rng(1000 + seed).permutation(rows - tested)[:9]]
        assert split.first(9).tolist() == drawn.tolist()
        assert set(split.first(5).tolist()) < set(split.first(9).tolist()), "smaller sets lie within larger ones"
