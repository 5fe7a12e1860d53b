# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the independent rigs share: only missing pairs are made, data and truth stay apart, angles are folded."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pytest

from benchmarks.support.making import add_make, truth_file
from benchmarks.support.plane import wrapped


def write(options: argparse.Namespace, number: int) -> None:
    """A stand-in for a simulator: the truth alone, made once."""
    with truth_file(options, number).open("x") as file:
        file.write(str(options.seed))


def run(folder: Path, *arguments: str) -> int:
    parser = argparse.ArgumentParser()
    add_make(parser, write)
    folders = ["--out", str(folder / "data"), "--truth", str(folder / "truth")]
    options = parser.parse_args([*folders, "--seed", "4", *arguments])
    status: int = options.work(options)
    return status


@pytest.mark.parametrize("cores", ["1", "2"])
def test_only_missing_pairs_are_made(tmp_path: Path, cores: str) -> None:
    for count in ("2", "3"):
        assert run(tmp_path, "--count", count, "--cores", cores) == 0
    assert sorted(path.name for path in (tmp_path / "truth").iterdir()) == ["000.json", "001.json", "002.json"]


def test_truth_within_the_data_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="must not contain each other"):
        run(tmp_path, "--count", "1", "--truth", str(tmp_path / "data" / "truth"))
    assert not list(tmp_path.iterdir())


def test_angles_are_folded_around_zero() -> None:
    turn = 2.0 * np.pi
    np.testing.assert_allclose(wrapped(np.array([0.1, 3.5, -3.5, 7.0])), [0.1, 3.5 - turn, turn - 3.5, 7.0 - turn])
