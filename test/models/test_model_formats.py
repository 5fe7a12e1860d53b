# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Model files of every format, as the releases that introduced the format wrote them, still give their predictions.

Each file in model_files/ was written by the last release that had its format as the newest, from 24 simulated windows;
predictions.json contains what that release predicted.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from push_predictor.models.mechanics.analytical import ACCURACY

from push_predictor.errors import ModelFileError
from push_predictor.models.predictors import (
    AnalyticalPredictor,
    ExtendedPredictor,
    GaussianProcessPredictor,
    MechanicsPredictor,
)
from push_predictor.models.store.model_file import FORMAT_VERSION, is_model_file, load_model, save_model

FILES = Path(__file__).parent / "model_files"
FORMATS = [version for version in range(1, FORMAT_VERSION + 1) if version != 2]  # 2 has kernels that are gone
INPUTS = np.array([[0.02, 0.1, 0.0], [0.02, 0.35, -0.4], [0.02, 0.8, 0.5]])
DURATION = np.full(3, 0.2)
COVARIATES = {"elapsed_time": np.array([0.0, 10.0, 20.0])}
PREDICTORS = {
    1: GaussianProcessPredictor,
    3: ExtendedPredictor,
    4: ExtendedPredictor,
    5: GaussianProcessPredictor,
    6: MechanicsPredictor,
    7: ExtendedPredictor,
    8: GaussianProcessPredictor,
}


def file_of(version: int) -> Path:
    return FILES / f"format_{version}.pushmodel"


def header_of(path: Path) -> dict[str, object]:
    with np.load(path) as archive:
        header: dict[str, object] = json.loads(archive["header"].tobytes())
    return header


@pytest.mark.parametrize("version", FORMATS)
def test_file_has_the_format_in_its_name(version: int) -> None:
    assert is_model_file(file_of(version)) and header_of(file_of(version))["format_version"] == version


@pytest.mark.parametrize("version", FORMATS)
def test_model_of_every_format_predicts_what_it_did(version: int) -> None:
    model = load_model(file_of(version))
    assert isinstance(model.predictor, PREDICTORS[version])
    expected = json.loads((FILES / "predictions.json").read_text())[f"format_{version}"]
    found = model.predict_rows(INPUTS, DURATION, COVARIATES)
    learnt_alone = isinstance(model.predictor, GaussianProcessPredictor) and model.predictor.mean is None
    np.testing.assert_allclose(found.mean, expected["mean"], rtol=1e-6 if learnt_alone else 0.1 * ACCURACY, atol=1e-9)
    np.testing.assert_allclose(found.covariance, expected["covariance"], rtol=1e-6, atol=1e-13)
    np.testing.assert_allclose(found.process_covariance, expected["process_covariance"], rtol=1e-6, atol=1e-13)


@pytest.mark.parametrize("version", FORMATS)
def test_model_is_saved_in_the_format_it_was_loaded_from(version: int, tmp_path: Path) -> None:
    model, path = load_model(file_of(version)), tmp_path / "again.pushmodel"
    save_model(model, path)
    before, after = header_of(file_of(version)), header_of(path)
    assert {**after, "written_by": before["written_by"]} == before


def test_parts_of_each_format_are_loaded() -> None:
    third, fourth, fifth, sixth, seventh, eighth = (load_model(file_of(v)).predictor for v in range(3, 9))
    assert isinstance(third.base, AnalyticalPredictor)
    assert [effect.mechanism for effect in third.effects] == ["contact_friction"] and not third.cross
    assert [effect.mechanism for effect in fourth.effects] == ["contact_friction", "pusher_radius"]
    assert list(fourth.cross) == [(0, 1)]
    assert isinstance(fifth, GaussianProcessPredictor) and fifth.correlation is not None
    assert isinstance(sixth, MechanicsPredictor) and "contact_friction" in sixth.fitted.values
    assert not any(effect.exact for effect in (*third.effects, *fourth.effects))
    assert isinstance(seventh.base, MechanicsPredictor) and all(effect.exact for effect in seventh.effects)
    assert fifth.tails is None and eighth.tails is not None


def test_model_with_kernels_that_are_gone_is_refused() -> None:
    with pytest.raises(ModelFileError, match="kernel family 'matern52' is not accepted, train the model again"):
        load_model(file_of(2))
