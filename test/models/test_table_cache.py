# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Tables kept on disk: a server reads what training computed, and a damaged or foreign table is never used."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from repository import REPOSITORY
from synthetic import noisy_pushes, square_rig

from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.push_model import PushModel
from push_predictor.models.store import table_cache
from push_predictor.models.store.archive import archived, read_archive
from push_predictor.models.store.model_file import load_model, model_digest, save_model
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.store.table_cache import (
    NO_TABLE_YET,
    as_served,
    completed,
    keep_tables,
    load_served,
    table_folder,
    tables_of,
)
from push_predictor.models.tabulated.tabulated_model import Probes, TabulatedModel, tabulate
from push_predictor.models.train import TrainingOptions, train_model


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder of kept tables."""
    place = tmp_path / "tables"
    monkeypatch.setenv("PUSH_PREDICTOR_CACHE", str(place))
    return place


@pytest.fixture(scope="module")
def model() -> PushModel:
    """A small VHGP of a circle, whose table has no axis of contacts and is computed in a fraction of the time."""
    rig = replace(square_rig(), shape="ellip1", outline=shape_outline("ellip1"))
    return train_model(noisy_pushes(45, rig=rig), rig, "vhgp", name="small", options=TrainingOptions(mean="zero"))


@pytest.fixture
def file(model: PushModel, tmp_path: Path) -> Path:
    """Its file."""
    path = tmp_path / "small.pushmodel"
    save_model(model, path)
    return path


@pytest.fixture(autouse=True)
def computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables are computed once for all tests, which are about their files."""
    monkeypatch.setattr(table_cache, "tabulate", once)


@pytest.fixture
def kept(file: Path, folder: Path) -> Path:
    """The file of its tables in the folder of kept tables."""
    load_served(file)
    return only(folder)


def once(model: PushModel) -> TabulatedModel:
    """The model with its table."""
    if (digest := model_digest(model)) not in COMPUTED:
        COMPUTED[digest] = tabulate(model)
    return COMPUTED[digest]


COMPUTED: dict[str, TabulatedModel] = {}
NODES = "nodes.3.{}"  # arrays of a file
MATRICES = {"solved", "functions"}  # of a VHGP, cached


def never(*_: object, **__: object) -> TabulatedModel:
    raise AssertionError("a table was computed")


def only(folder: Path) -> Path:
    (found,) = folder.iterdir()
    return found


def rewrite(path: Path, change: Callable[[dict[str, Any], dict[str, np.ndarray]], object]) -> None:
    """Change the record and the arrays of a file of tables."""
    record, arrays = read_archive(path)
    change(record, arrays)
    path.write_bytes(archived(record, arrays))


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


def test_a_server_does_not_keep_the_matrices(file: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They take 50 MB."""
    monkeypatch.setattr(table_cache, "tabulate", tabulate)
    load_served(file)
    served = load_served(file)
    regressions = served.model.predictor.base.regressions  # type: ignore[attr-defined]  # of a VHGP
    assert not any(MATRICES & vars(regression).keys() for regression in regressions)
    outside = served.model.training.inputs[:1] * [1.9, 1.0, 1.0]
    found = served.predict_rows(outside, served.model.training.duration[:1])
    assert np.all(np.isfinite(found.mean)) and not found.in_domain.any()
    assert not any(MATRICES & vars(regression).keys() for regression in regressions), "nor for others"


def test_a_model_without_tables_predicts_exactly_until_they_are_computed(
    file: Path, model: PushModel, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table_cache, "tabulate", tabulate)
    registry, rows = ModelRegistry(), model.training
    assert registry.load_all([str(file)], at_once=True) == [] and not folder.exists()
    at_once = registry.get("small")
    assert registry.answering == [f"small: {NO_TABLE_YET}"] and not at_once.tabulated
    exact = at_once.predict_rows(rows.inputs, rows.duration)
    assert np.array_equal(exact.mean, model.predict_rows(rows.inputs, rows.duration).mean)
    registry.complete()
    after = registry.get("small")
    assert after.tabulated and only(folder).suffix == ".tables"
    regressions = after.model.predictor.base.regressions  # type: ignore[attr-defined]  # of a VHGP
    assert not any(MATRICES & vars(regression).keys() for regression in regressions)
    found = after.predict_rows(rows.inputs, rows.duration)
    assert np.max(np.abs(found.mean - exact.mean) / exact.std) < 1e-3
    monkeypatch.setattr(table_cache, "tabulate", never)
    kept = load_served(file, at_once=True)  # the table is on disk now
    assert kept.tabulated and completed(kept) is kept and completed(after) is after


def test_completion_ends_when_it_is_cancelled(file: Path, folder: Path) -> None:
    registry = ModelRegistry()
    registry.load(file, at_once=True)
    registry.complete(lambda: True)
    assert registry.answering == [f"small: {NO_TABLE_YET}"]


def test_completion_does_not_undo_what_was_loaded_meanwhile(
    file: Path, model: PushModel, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = file.with_name("other.pushmodel")
    save_model(train_model(noisy_pushes(40), square_rig(), "analytical", name="other"), other)
    registry = ModelRegistry()
    registry.load(file, at_once=True)

    def slowly(served: TabulatedModel) -> TabulatedModel:
        registry.load(other, "small")
        registry.load(other, "other")
        return completed(served)

    monkeypatch.setattr("push_predictor.models.store.model_registry.completed", slowly)
    registry.complete()
    assert registry.get("small").model.kind == "analytical" and registry.names == ["small", "other"]


def test_training_writes_the_table_next_to_the_model(
    file: Path, model: PushModel, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_tables(model, file)
    monkeypatch.setattr(table_cache, "tabulate", never)
    moved = file.with_name("moved.model")
    file.rename(moved)
    tables_of(file).rename(tables_of(moved))
    assert load_served(moved).tabulated and not folder.exists()


def test_a_device_gets_no_table_next_to_it(model: PushModel, tmp_path: Path) -> None:
    keep_tables(model, tmp_path / "pipe")
    assert not list(tmp_path.iterdir())


def test_a_validation_uses_the_table_of_the_server(
    file: Path, model: PushModel, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    load_served(file)
    monkeypatch.setattr(table_cache, "tabulate", never)
    assert as_served(model).tabulated and as_served(load_model(file)).tabulated
    keep_tables(model, file)
    assert tables_of(file).exists()


def test_the_shipped_model_has_its_table(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_cache, "tabulate", never)
    served = load_served(REPOSITORY / "resource" / "simulated_square_abs.pushmodel")
    assert served.tabulated and not folder.exists()


def flip(path: Path, place: int) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= 1
    path.write_bytes(data)


def rewritten(change: Callable[[dict[str, Any], dict[str, np.ndarray]], object]) -> Callable[[Path], None]:
    return lambda path: rewrite(path, change)


@pytest.mark.parametrize(
    "damage",
    [
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(b"{}"),
        lambda path: path.write_bytes(path.read_bytes()[:-9]),
        lambda path: flip(path, path.stat().st_size // 2),
        rewritten(lambda record, arrays: record.update(format_version=2)),
        rewritten(lambda record, arrays: record.update(model="another")),
        rewritten(lambda record, arrays: record.update(nodes=[[16], [16], [0.0], []])),
        rewritten(lambda record, arrays: record.update(nodes="none")),
        rewritten(lambda record, arrays: record["nodes"].__setitem__(0, [100_000] * 3)),
        rewritten(lambda record, arrays: record["nodes"].__setitem__(2, None)),
        rewritten(lambda record, arrays: record["nodes"][3].pop()),
        rewritten(lambda record, arrays: record.update(error=[1.0])),
        rewritten(lambda record, arrays: record.update(probes=[])),
        rewritten(lambda record, arrays: arrays.pop(NODES.format(8))),
        rewritten(lambda record, arrays: arrays.update({NODES.format(0): arrays[NODES.format(0)] + np.nan})),
        rewritten(lambda record, arrays: arrays.update({NODES.format(4): arrays[NODES.format(4)] * 1.5})),
        rewritten(lambda record, arrays: record.clear()),
        *(
            rewritten(lambda record, arrays, name=f"probes.{number}": arrays.update({name: 1.02 * arrays[name]}))
            for number, name in enumerate(Probes.__dataclass_fields__)
            if name != "inputs"  # a table that predicts otherwise than the model
        ),
    ],
)
def test_a_damaged_table_or_that_of_another_model_is_computed_again(
    file: Path, kept: Path, damage: Callable[[Path], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    right, how, computed = read_archive(kept)[0], load_served(file).how, list[PushModel]()
    damage(kept)
    monkeypatch.setattr(table_cache, "tabulate", lambda model: computed.append(model) or once(model))
    assert load_served(file).how == how and read_archive(kept)[0] == right and len(computed) == 1
    monkeypatch.setattr(table_cache, "tabulate", never)
    assert load_served(file).how == how


def test_models_that_predict_alike_share_a_table_and_others_do_not(file: Path, model: PushModel, folder: Path) -> None:
    load_served(file)
    other = file.with_name("other.pushmodel")
    save_model(replace(model, name="other"), other)
    load_served(other)
    assert len(list(folder.iterdir())) == 1
    outcomes = model.training.outcomes + [1e-9, 0.0, 0.0]
    save_model(replace(model, training=replace(model.training, outcomes=outcomes)), other)
    load_served(other)
    assert len(list(folder.iterdir())) == 2


def test_only_the_tables_used_last_are_kept(file: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_cache, "MOST_TABLES", 2)
    for version in (1, 2, 1, 3):
        monkeypatch.setattr(table_cache, "FORMAT_VERSION", version)
        load_served(file)
    digest = model_digest(load_model(file))
    assert {path.name for path in folder.iterdir()} == {f"{digest}.1.tables", f"{digest}.3.tables"}


def test_a_folder_that_takes_no_files_is_no_error(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PUSH_PREDICTOR_CACHE", str(file / "tables"))
    assert load_served(file).tabulated


def test_the_folder_follows_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PUSH_PREDICTOR_CACHE", str(tmp_path))
    assert table_folder() == tmp_path
    monkeypatch.delenv("PUSH_PREDICTOR_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert table_folder() == tmp_path / "push_predictor"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert table_folder() == tmp_path / ".cache" / "push_predictor"
