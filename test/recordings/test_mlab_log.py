# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The push logs of MLab_EXP: numbers as written, and every wrong line named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from push_predictor.errors import ImportSourceError
from push_predictor.recordings.importers.mlab import read_log
from push_predictor.recordings.importers.staging import Notes

POSE = "1 2 3 1 0 0 0"
LINES = ["1", POSE, POSE, "2", "0.5 1e-3 -2", "0.6 1 2", "1", f"0.7 {POSE}"]


def log(folder: Path, *changes: tuple[int, str]) -> Path:
    """A log of one push with some lines changed."""
    lines = list(LINES)
    for place, line in changes:
        lines[place] = line
    path = folder / "log.txt"
    path.write_text("\n".join(lines))
    return path


def test_tables_have_the_numbers_of_their_lines(tmp_path: Path) -> None:
    (push,) = read_log(log(tmp_path), Notes())
    np.testing.assert_array_equal(push.force, [[0.5, 1e-3, -2.0], [0.6, 1.0, 2.0]])
    np.testing.assert_array_equal(push.robot, [[0.7, 1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0]])


@pytest.mark.parametrize("line", ["0.6 1 nan", "0.6 1 inf", "0.6 1", "0.6 1 2 3", "0.6 1 x"])
def test_a_wrong_line_of_a_table_is_named(tmp_path: Path, line: str) -> None:
    with pytest.raises(ImportSourceError, match=r"log\.txt:6: '0\.6 1.*', expected force: 3 finite numbers"):
        read_log(log(tmp_path, (5, line)), Notes())
