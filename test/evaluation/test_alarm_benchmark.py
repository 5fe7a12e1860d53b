# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The table of the alarm's benchmark: what counts as false, as detected, and as late."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.blind import alarm
from benchmarks.blind.alarm import Row


def row(change: int | None, fired: int | None) -> Row:
    return Row(0, "rect1 on abs", "vhgp", change, fired, "dy" if fired else None)


def test_alarm_before_the_change_is_false_and_after_it_has_a_delay() -> None:
    assert (row(None, None).false, row(None, 7).false, row(100, 100).false, row(100, 101).false) == (
        False,
        True,
        True,
        False,
    )
    assert [row(100, fired).delay for fired in (None, 90, 101, 130)] == [None, None, 1, 30]
    assert row(None, 7).delay is None


def test_recordings_that_are_there_are_not_judged_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    judged: list[int] = []

    def rows(seed: int, count: int) -> list[Row]:
        judged.append(seed)
        return [Row(seed, "hex on pu", "vhgp", None, None, None)] * count

    monkeypatch.setattr(alarm, "rows_without_change", rows)
    for models in ("2", "3"):
        alarm.main(["unchanged", "--out", str(tmp_path), "--models", models, "--streams", "4", "--first", "7"])
    assert judged == [7, 8, 9] and len(list(tmp_path.iterdir())) == 3
