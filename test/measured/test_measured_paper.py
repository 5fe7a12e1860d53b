# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The real measured data in the paper's tables: what is found of them, the rows the splits deal, the figures told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.data.measured import measured_corpora
from push_predictor_paper.fits.fit import Fit, SplitName, random_split, scores
from push_predictor_paper.work import Work

from benchmarks.measured.ladder import BASES, load, mlab, textbook
from push_predictor.evaluation.estimate import by_push, total_nlpd, total_nmse
from push_predictor.evaluation.push_scores import PushScores, pooled, push_scores
from push_predictor.evaluation.splits import FOLDS, split_by_push
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.load import different_supports
from push_predictor.residuals.evidence.loading import LoadedData
from push_predictor.residuals.evidence.standardised import held_out_rows
from push_predictor.residuals.extension.held_out_gain import compared
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.trace import trace

PAIR = ("rect1", "unknown")


@pytest.fixture(scope="module")
def found(measured_data: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Corpus, ...]:
    folder = tmp_path_factory.mktemp("paper")
    return measured_corpora(measured_data, Work(folder / "work", cores=1), folder / "scratch")


def test_the_square_is_found_with_the_counts_of_its_source(found: tuple[Corpus, ...]) -> None:
    (square,) = found
    table = square.sets[PAIR].table
    assert (square.origin, square.reference) == ("measured", PAIR)
    assert (len(table), len(table.pushes)) == (3500, 89)
    assert set(table.inputs[:, 0]) == {0.02} and set(table.duration) == {0.2}
    assert "3500 overlapping windows of 89 pushes" in square.title and "estimate" in square.title


def test_one_push_of_a_hexagon_is_too_little_and_is_named(found: tuple[Corpus, ...]) -> None:
    assert found[-1].notes[0].endswith("; skipped: hex on plywood (too few; pushes: 1, windows: 1).")


def test_the_splits_have_the_rows_that_the_tables_of_the_docs_state(found: tuple[Corpus, ...]) -> None:
    table = found[0].sets[PAIR].table
    push = np.unique(table.push_id.astype(np.int64), return_inverse=True)[1]
    folds = np.random.default_rng(0).permutation(89)[push] % 5
    order = np.random.default_rng(0).permutation(3500)
    for k in range(FOLDS):
        whole, rows = split_by_push(table, k), random_split(len(table), k)
        others = np.flatnonzero(folds != k)
        np.testing.assert_array_equal(whole.test, np.flatnonzero(folds == k))
        np.testing.assert_array_equal(whole.training, others[np.random.default_rng(k).permutation(len(others))])
        np.testing.assert_array_equal(rows.test, order[:1000])
        np.testing.assert_array_equal(rows.training, order[1000:][np.random.default_rng(1000 + k).permutation(2500)])
        assert not set(push[whole.training].tolist()) & set(push[whole.test].tolist())


# NMSE and NLPD at n = 100, all tested rows together: benchmarks/measured/RESULTS.md
ScoresOf = Callable[[SplitName, str], PushScores]


@pytest.fixture(scope="module")
def scores_of(found: tuple[Corpus, ...], tmp_path_factory: pytest.TempPathFactory) -> ScoresOf:
    """The scores of all folds of a split and a kind of model, computed once."""
    work = Work(tmp_path_factory.mktemp("fits"), cores=1)

    def fitted(split: SplitName, kind: str) -> PushScores:
        done = scores(work, found[0], [(PAIR, Fit(kind, 100, split, k)) for k in range(FOLDS)])
        return pooled([score.push_scores for score in done.values()])

    return cache(fitted)


@pytest.mark.parametrize(
    ("split", "kind", "nmse", "nlpd"),
    [
        ("random", "analytical", 0.221, -16.82),
        pytest.param("random", "gp", 0.153, -17.40, marks=pytest.mark.long),
        pytest.param("random", "vhgp", 0.149, -17.54, marks=pytest.mark.long),
        ("push", "analytical", 0.228, -16.65),
        ("push", "gp", 0.189, -17.09),
        ("push", "vhgp", 0.180, -17.19),
    ],
)
def test_a_fit_of_the_paper_has_the_scores_of_the_docs(
    scores_of: ScoresOf, split: SplitName, kind: str, nmse: float, nlpd: float
) -> None:
    push_scores = scores_of(split, kind)
    assert by_push(push_scores, total_nmse).value == pytest.approx(nmse, abs=0.0015)
    assert by_push(push_scores, total_nlpd).value == pytest.approx(nlpd, abs=0.015)


def test_the_exact_density_of_vhgp_is_better_than_gp_on_held_out_pushes(scores_of: ScoresOf) -> None:
    gp, vhgp = (scores_of("push", kind).totals() for kind in ("gp", "vhgp"))
    assert vhgp.exact_nlpd.sum() < gp.nlpd.sum()


# --- measured ladder --------------------------------------------------------------------------------------------------


EVEN = 0.0451  # m: mean distance from the centre of an even triangle
# Mean distance (m) of the support points from the centre, by recording; 2 and 6 lay flat.
SPREAD = {0: 0.0785, 1: 0.0392, 3: 0.0589, 4: 0.0168, 5: 0.0392}


def some(data: LoadedData, every: int) -> LoadedData:
    """The windows of every so manieth push: what is found is the same, in a part of the time."""
    table = data.table
    return replace(data, table=table.take(np.isin(table.push_id, table.pushes[::every])))


def error(model: PushModel, found: Trace) -> float:
    """NMSE on the pushes that a trace held out."""
    return float(total_nmse(push_scores(compared(model, found.held_out.table, found.model.training_mean)).totals())[0])


@pytest.mark.long
def test_the_first_effect_on_mlab_is_the_support_of_each_recording(measured_data: Path) -> None:
    measured = load("mlab", measured_data)
    measured = replace(measured, data=some(measured.data, 2))
    found = trace(textbook(measured), measured.data)
    first = found.terms[0]
    assert (first.mechanism, first.covariate, first.basis.name) == ("pressure_spread", "recording", "category")
    assert first.basis.offset  # the first coefficient is of all recordings, the others of each that follows
    by_recording = first.coefficients[0] + np.concatenate([[0.0], first.coefficients[1:]])
    truth = np.log(np.array(list(SPREAD.values())) / EVEN)
    assert np.array_equal(np.sign(by_recording[list(SPREAD)]), np.sign(truth))
    assert np.corrcoef(by_recording[list(SPREAD)], truth)[0, 1] > 0.95
    assert found.extended is not None
    assert error(found.extended, found) < 0.5 * error(found.model, found)


@pytest.mark.long
@pytest.mark.parametrize(("base", "before", "after"), [("textbook", 0.247, 0.177), ("exact", 0.215, 0.153)])
def test_trace_explains_the_square_from_the_exact_model_as_well_as_a_fit_and_less_from_an_ellipsoid(
    base: str, before: float, after: float, measured_data: Path
) -> None:
    """Fitted mechanics, with the exact limit surface, reach 0.150; the textbook's is an ellipsoid."""
    measured = load("mit-square", measured_data)
    found = trace(BASES[base](measured), measured.data, covariates=["edge"])  # others would double the time
    assert found.extended is not None and found.gain_nlpd.high < 0.0
    assert error(found.model, found) == pytest.approx(before, abs=0.002)
    assert error(found.extended, found) == pytest.approx(after, abs=0.002)


@pytest.mark.long
def test_fitted_mechanics_explain_two_thirds_of_the_error_on_mlab(measured_data: Path, tmp_path: Path) -> None:
    loaded = some(mlab(measured_data, tmp_path), 2)
    aside = held_out_rows(loaded.table)
    search, held = loaded.table.take(~aside), loaded.table.take(aside)
    options = TrainingOptions(fit=True, supports=different_supports(sorted(tmp_path.glob("*.csv"))))
    model = train_model(search, loaded.rig, "analytical", name="fitted", options=options)
    textbook = train_model(search, loaded.rig, "analytical", name="textbook")
    nmse, before = (
        total_nmse(push_scores(compared(m, held, model.training_mean)).totals())[0] for m in (model, textbook)
    )
    assert nmse < 0.27 and before > 0.65
