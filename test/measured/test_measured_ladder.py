# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The residual loop on measured pushes finds what the recordings differ in: their names tell us, nobody tells it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.measured.ladder import BASES, load, mlab, textbook
from push_predictor.evaluation.estimate import total_nmse
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.load import different_supports
from push_predictor.residuals.evidence.loading import LoadedData
from push_predictor.residuals.evidence.standardised import held_out_rows
from push_predictor.residuals.extension.held_out_gain import compared
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.trace import trace

pytestmark = pytest.mark.long

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
