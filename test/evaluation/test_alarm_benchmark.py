# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The table of the alarm's benchmark: what counts as false, as detected, and as late."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.blind import null_streams
from benchmarks.blind.alarm import Row
from benchmarks.blind.null_streams import Stream


def row(change: int | None, fired: int | None) -> Row:
    return Row(0, "rect1 on abs", 300, change, fired, "dy" if fired else None, 2.0)


def test_alarm_before_the_change_is_false_and_after_it_has_a_delay() -> None:
    assert (row(None, None).false, row(None, 7).false, row(100, 100).false, row(100, 101).false) == (
        False,
        True,
        True,
        False,
    )
    assert [row(100, fired).delay for fired in (None, 90, 101, 130)] == [None, None, 1, 30]
    assert row(None, 7).delay is None


def test_streams_that_are_there_are_not_judged_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    judged: list[int] = []

    def streams_of(seed: int, count: int) -> list[Stream]:
        judged.append(seed)
        return [Stream(seed, "hex on pu", "vhgp", None, None, -0.2)] * count

    monkeypatch.setattr(null_streams, "streams_of", streams_of)
    for models in ("2", "3"):
        null_streams.main(["--out", str(tmp_path), "--models", models, "--streams", "4", "--first", "7"])
    assert judged == [7, 8, 9] and len(list(tmp_path.iterdir())) == 3
