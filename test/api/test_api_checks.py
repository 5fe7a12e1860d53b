# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The functions of the Python interface check their data: warnings of a category, errors where they are strict."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mistakes import tracked
from repository import BAGS

from push_predictor import DataWarning, PushModel, trace, train, validate
from push_predictor.errors import RecordingError
from push_predictor.recordings.load import load_data
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.table_file import write_table
from push_predictor.recordings.write import write_recording

HEXAGON, ROUND = BAGS / "hexagon_delrin", BAGS / "circle_pu"


def quiet(stage: str, done: float) -> None:
    """No progress."""


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording whose tracked frame is turned by 8 degrees and shifted by 4 mm."""
    path = tmp_path_factory.mktemp("turned") / "turned"
    write_recording(path, tracked(read_recording(HEXAGON), np.radians(8.0), (0.004, 0.0)))
    return path


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> PushModel:
    """An analytical model of the hexagon, trained on half of its pushes."""
    folder, table, rig = tmp_path_factory.mktemp("half"), load_data([HEXAGON]), read_recording(HEXAGON).rig
    assert rig is not None
    write_table(folder / "half.csv", table.take(np.isin(table.push_id, table.pushes[:5])))
    return train(folder / "half.csv", kind="analytical", rig=rig, watch=quiet)


@pytest.fixture
def loaded_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """A trace ends once its data are loaded."""
    monkeypatch.setattr("push_predictor.residuals.trace.trace", lambda *_, **__: None)


def warned(call: Callable[[], object]) -> list[str]:
    """The messages of the warnings of a call; each has the category, and names a line of this file."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    assert all(each.category is DataWarning and each.filename == __file__ for each in caught)
    return [str(each.message) for each in caught]


@pytest.mark.parametrize(
    "call",
    [
        lambda model, path, **strict: train(path, kind="analytical", watch=quiet, **strict),
        lambda model, path, **strict: validate(model, path, **strict),
        lambda model, path, **strict: trace(model, path, watch=quiet, **strict),
    ],
    ids=["train", "validate", "trace"],
)
def test_a_turned_and_shifted_recording_warns_wherever_it_enters_and_is_an_error_if_strict(
    turned: Path, model: PushModel, loaded_only: None, call: Callable[..., object]
) -> None:
    found = [text for text in warned(lambda: call(model, turned)) if "turned by" in text]
    assert len(found) == 1 and found[0].startswith(f"{turned}: ")
    with pytest.raises(RecordingError, match="turned by"):
        call(model, turned, strict=True)


@pytest.mark.usefixtures("loaded_only")
def test_a_sound_recording_is_silent_and_passes_if_strict(model: PushModel) -> None:
    assert warned(lambda: train(ROUND, kind="analytical", watch=quiet, strict=True)) == []
    assert warned(lambda: trace(model, HEXAGON, watch=quiet, strict=True)) == []


def test_a_learnt_model_of_few_pushes_warns(tmp_path: Path) -> None:
    """test_data_checks has for which models, and when it is an error."""
    table, rig = load_data([HEXAGON]), read_recording(HEXAGON).rig
    write_table(tmp_path / "few.csv", table.take(np.isin(table.push_id, table.pushes[:5])))
    (text,) = warned(lambda: train(tmp_path / "few.csv", rig=rig, watch=quiet, kind="gp", mean="zero"))
    assert text.startswith(f"{tmp_path / 'few.csv'}: The data contain 5 pushes")


def test_a_validation_warns_of_training_pushes_and_of_another_slider(model: PushModel) -> None:
    (text,) = warned(lambda: validate(model, HEXAGON))
    assert "were used for training" in text
    (text,) = warned(lambda: validate(model, ROUND))
    assert "was trained with the outline of 'hex'" in text


def test_a_validation_warns_of_faults_of_the_streams_also_if_strict(model: PushModel, tmp_path: Path) -> None:
    """They do not make the data wrong."""
    write_recording(tmp_path / "blind", replace(read_recording(HEXAGON), wrench=None))
    assert any(
        "no wrench was recorded" in text for text in warned(lambda: validate(model, tmp_path / "blind", strict=True))
    )
