"""The residual loop on measured pushes finds what the recordings differ in: their names tell us, nobody tells it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.measured.ladder import climb, mlab, named
from push_predictor.evaluation.estimate import total_nmse
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.load import different_supports
from push_predictor.residuals.evidence.split import held_out_rows
from push_predictor.residuals.extension.held_out_gain import compared

EVEN = 0.0451  # m: mean distance from the centre of an even triangle
# Mean distance (m) of the support points from the centre, by recording; 2 and 6 lay flat.
SPREAD = {0: 0.0785, 1: 0.0392, 3: 0.0589, 4: 0.0168, 5: 0.0392}


def test_the_first_step_on_mlab_is_the_support_of_each_recording(measured_data: Path, tmp_path: Path) -> None:
    _, step = climb(mlab(measured_data, tmp_path), most_tries=1)
    assert named(step) == "pressure_spread by recording (category)"
    assert not step.refused
    assert step.effect is not None
    found = step.effect.coefficients[list(SPREAD)]
    truth = np.log(np.array(list(SPREAD.values())) / EVEN)
    assert np.array_equal(np.sign(found), np.sign(truth))
    assert np.corrcoef(found, truth)[0, 1] > 0.95
    assert found == pytest.approx(0.65 * truth, abs=0.12)  # first order: large changes come out too small


def test_fitted_mechanics_explain_two_thirds_of_the_error_on_mlab(measured_data: Path, tmp_path: Path) -> None:
    loaded = mlab(measured_data, tmp_path)
    aside = held_out_rows(loaded.table)
    search, held = loaded.table.take(~aside), loaded.table.take(aside)
    options = TrainingOptions(fit=True, supports=different_supports(sorted(tmp_path.glob("*.csv"))))
    model = train_model(search, loaded.rig, "analytical", name="fitted", options=options)
    textbook = train_model(search, loaded.rig, "analytical", name="textbook")
    nmse, before = (
        total_nmse(push_scores(compared(m, held, model.training_mean)).totals())[0] for m in (model, textbook)
    )
    assert nmse < 0.27 and before > 0.65
