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

"""Tables kept on disk: a server reads what training computed, and a damaged or foreign table is never used."""

from __future__ import annotations

import json
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import noisy_pushes, square_rig

from push_predictor.errors import ModelFileError
from push_predictor.models.predictors import PriorPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.store import table_cache
from push_predictor.models.store.model_file import save_model
from push_predictor.models.store.table_cache import keep_table, load_served, table_folder
from push_predictor.models.tabulated import tabulated_prior
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.models.train import train_model
from push_predictor.recordings.table import empty_table


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder of kept tables."""
    place = tmp_path / "tables"
    monkeypatch.setenv("PUSH_PREDICTOR_CACHE", str(place))
    return place


@pytest.fixture(scope="module")
def model() -> PushModel:
    """A small VHGP."""
    return train_model(noisy_pushes(60), square_rig(), "vhgp", name="small")


@pytest.fixture
def file(model: PushModel, tmp_path: Path) -> Path:
    """Its file."""
    path = tmp_path / "small.pushmodel"
    save_model(model, path)
    return path


def never(*_: object, **__: object) -> TabulatedModel:
    raise AssertionError("a table was computed")


def only(folder: Path, ending: str) -> Path:
    (found,) = folder.glob(f"*{ending}")
    return found


def test_a_kept_table_predicts_as_the_one_computed(
    file: Path, model: PushModel, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    computed = load_served(file)
    monkeypatch.setattr(table_cache, "tabulate", never)
    kept = load_served(file)
    rows = model.training
    one, other = (served.predict_rows(rows.inputs, rows.duration) for served in (computed, kept))
    for name in ("mean", "covariance", "process_covariance", "in_domain"):
        assert np.array_equal(getattr(one, name), getattr(other, name))
    assert kept.how == computed.how and kept.error == computed.error and kept.tabulated


def test_matrices_are_not_computed_for_a_kept_table(file: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load_served(file)
    served = load_served(file)
    regressions = served.model.predictor.base.regressions  # type: ignore[attr-defined]
    assert not any("_posterior" in vars(regression) for regression in regressions)
    outside = served.model.training.inputs[:1] + [10.0, 0.0, 0.0]
    found = served.predict_rows(outside, served.model.training.duration[:1])
    assert np.all(np.isfinite(found.mean)) and not found.in_domain.any()
    assert all("_posterior" in vars(regression) for regression in regressions)


def test_training_keeps_the_table_for_servers(
    file: Path, model: PushModel, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_table(model, file)
    monkeypatch.setattr(table_cache, "tabulate", never)
    assert load_served(file).tabulated
    keep_table(model, file)


def test_the_table_of_a_prior_model_is_kept_and_checked(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tabulated_prior, "CELL", 0.03)
    monkeypatch.setattr(tabulated_prior, "ANGLE_CELLS", 5)
    monkeypatch.setattr(tabulated_prior, "MEAN_TOLERANCE", 3.0)
    monkeypatch.setattr(tabulated_prior, "SPREAD_TOLERANCE", 3.0)
    model, file = train_model(empty_table(), square_rig(), "prior", name="prior"), tmp_path / "prior.pushmodel"
    assert isinstance(model.predictor, PriorPredictor)
    few_draws = replace(model.predictor, draws=model.predictor.draws[:8])  # the table takes an eighth of the time
    save_model(replace(model, predictor=few_draws), file)
    computed = load_served(file)
    with monkeypatch.context() as patch:
        patch.setattr(table_cache, "tabulate", never)
        kept = load_served(file)
        assert kept.how == computed.how and "table of" in kept.how
        pushes, duration = np.array([[0.02, 0.1, 0.2], [0.03, 0.6, -0.3]]), np.full(2, 0.2)
        one, other = (served.predict_rows(pushes, duration) for served in (computed, kept))
        assert np.array_equal(one.mean, other.mean) and np.array_equal(one.covariance, other.covariance)
    array = only(folder, ".npy")
    wrong = 1.5 * np.load(array) + 1.0
    np.save(array, wrong)
    record = only(folder, ".json")
    record.write_text(json.dumps({**json.loads(record.read_text()), "checksum": zlib.crc32(array.read_bytes())}))
    again = load_served(file)
    assert np.array_equal(again.predict_rows(pushes, duration).mean, one.mean)


@pytest.mark.parametrize("ending", [".json", ".npy"])
@pytest.mark.parametrize("content", [b"", b"{}", b"[1]", "cut", "flipped", None])
def test_a_damaged_table_is_computed_again(
    file: Path, folder: Path, ending: str, content: bytes | str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = load_served(file)
    damaged = only(folder, ending)
    whole = damaged.read_bytes()
    if content is None:
        damaged.unlink()
    elif content == "cut":
        damaged.write_bytes(whole[:-9])
    elif content == "flipped":
        middle = len(whole) // 2
        damaged.write_bytes(whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :])
    else:
        assert isinstance(content, bytes)
        damaged.write_bytes(content)
    assert load_served(file).how == expected.how
    monkeypatch.setattr(table_cache, "tabulate", never)
    assert load_served(file).how == expected.how


@pytest.mark.parametrize(
    "change",
    [
        {"axes": [[0.0, 1.0, 16]]},
        {"axes": "none"},
        {"columns": [0, 1]},
        {"least": None},
        {"error": [1.0]},
        {"probes": {}},
    ],
    ids=lambda change: next(iter(change)),
)
def test_a_record_that_does_not_fit_is_computed_again(file: Path, folder: Path, change: dict[str, object]) -> None:
    expected = load_served(file)
    record = only(folder, ".json")
    record.write_text(json.dumps({**json.loads(record.read_text()), **change}))
    assert load_served(file).how == expected.how


@pytest.mark.parametrize("name", ["mean", "covariance", "process_covariance"])
def test_a_table_that_predicts_otherwise_than_the_model_is_not_used(file: Path, folder: Path, name: str) -> None:
    load_served(file)
    record = only(folder, ".json")
    content = json.loads(record.read_text())
    content["probes"][name] = (np.array(content["probes"][name]) * 1.02).tolist()
    record.write_text(json.dumps(content))
    load_served(file)
    assert json.loads(record.read_text())["probes"] != content["probes"]


def test_another_model_or_other_code_has_its_own_table(
    file: Path, model: PushModel, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    load_served(file)
    other = file.with_name("other.pushmodel")
    save_model(replace(model, name="other"), other)
    load_served(other)
    monkeypatch.setattr(table_cache, "_code", lambda: b"later")
    load_served(file)
    assert len(list(folder.glob("*.json"))) == 3


def test_only_the_tables_used_last_are_kept(file: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_cache, "MOST_TABLES", 2)
    for version in (b"1", b"2", b"1", b"3"):
        monkeypatch.setattr(table_cache, "_code", lambda version=version: version)
        load_served(file)
    assert len(list(folder.glob("*.json"))) == len(list(folder.glob("*.npy"))) == 2
    monkeypatch.setattr(table_cache, "tabulate", never)
    for version in (b"1", b"3"):
        monkeypatch.setattr(table_cache, "_code", lambda version=version: version)
        load_served(file)


def test_a_folder_that_takes_no_files_is_no_error(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PUSH_PREDICTOR_CACHE", str(file / "tables"))
    assert load_served(file).tabulated


def test_a_missing_model_file_is_named(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(ModelFileError, match="nowhere"):
        load_served(tmp_path / "nowhere.pushmodel")


def test_the_folder_follows_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PUSH_PREDICTOR_CACHE", str(tmp_path))
    assert table_folder() == tmp_path
    monkeypatch.delenv("PUSH_PREDICTOR_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert table_folder() == tmp_path / "push_predictor"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert table_folder() == tmp_path / ".cache" / "push_predictor"
