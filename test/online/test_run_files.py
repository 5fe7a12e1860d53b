# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The table of windows that a validator keeps while a run is open."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_windows import made_up_windows
from synthetic import square_rig

from push_predictor.online.run_files import RunFiles
from push_predictor.recordings.table_file import read_table, rig_of_table
from push_predictor.recordings.windows.push_window import windows_to_table


@pytest.mark.parametrize(("first", "before"), [({"topic:/warmth": 1.5}, 1.5), ({}, np.nan)])
def test_windows_before_a_scalar_get_its_first_value_or_none(
    tmp_path: Path, first: dict[str, float], before: float
) -> None:
    early = made_up_windows(5, seed=1)
    late = [replace(w, covariates={**w.covariates, "topic:/warmth": 2.5}) for w in made_up_windows(3, seed=2)]
    table = RunFiles(tmp_path, square_rig())
    table.add(early[:2], [])
    table.add(early[2:], early[:2])
    table.add(late, early, first)
    table.add([], [*early, *late], first)
    kept, whole = read_table(table.path), windows_to_table([*early, *late])
    assert np.array_equal(kept.covariates["topic:/warmth"], [before] * 5 + [2.5] * 3, equal_nan=True)
    for name in ("inputs", "duration", "outcomes", "push_id"):
        assert np.array_equal(getattr(kept, name), getattr(whole, name)), name
    assert rig_of_table(table.path) is not None and not table.failure


def test_a_table_that_cannot_be_written_is_a_problem_and_no_error(tmp_path: Path) -> None:
    table = RunFiles(tmp_path / "gone", square_rig())
    (tmp_path / "gone").write_text("a file")
    windows = made_up_windows(2, seed=1)
    table.add(windows, [])
    assert table.failure.startswith("Windows and residuals are no longer saved: ") and str(tmp_path) in table.failure
    (tmp_path / "gone").unlink()
    (tmp_path / "gone").mkdir()
    table.add(windows, [])
    table.add_residual("gp", windows[0], np.zeros(3), np.eye(3))
    assert not list((tmp_path / "gone").iterdir()), "a table with a gap would be no table of the run"
