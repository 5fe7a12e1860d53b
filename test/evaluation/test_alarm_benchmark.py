# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The table of the alarm's benchmark: what counts as false, as detected, and as late."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.blind import null_streams
from benchmarks.blind.alarm import Row, markdown_of
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


def test_table_counts_recordings_with_intervals() -> None:
    text = markdown_of(
        [*[row(None, None)] * 9, row(None, 7), row(100, 120), row(100, 110), row(100, 50), row(100, None)]
    )
    assert "| false alarms, recordings without a change | 1 | 10 | 0.02 to 0.40 |" in text
    assert "| false alarms, before the change | 1 | 4 | 0.05 to 0.70 |" in text
    assert "| changes detected before the end | 2 | 4 | 0.15 to 0.85 |" in text
    assert "10, 20; median 15" in text


def test_table_of_null_streams_counts_false_alarms_of_each_base() -> None:
    fired = Stream(3, "hex on pu", "vhgp", 40, "dy", 2.5)
    plain = [Stream(seed, "hex on pu", kind, None, None, -0.2) for seed in (3, 4) for kind in ("vhgp", "analytical")]
    text = null_streams.markdown_of([fired, *plain])
    assert "| vhgp | 2 | 3 | 1 | 0.333 | 0.061 to 0.792 | 1 |" in text
    assert "| analytical | 2 | 2 | 0 | 0.000 | 0.000 to 0.658 | 0 |" in text
    assert "- seed 3, hex on pu, vhgp: dy, push 40" in text


def test_streams_that_are_there_are_not_judged_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    judged: list[int] = []

    def streams_of(seed: int, count: int) -> list[Stream]:
        judged.append(seed)
        return [Stream(seed, "hex on pu", "vhgp", None, None, -0.2)] * count

    monkeypatch.setattr(null_streams, "streams_of", streams_of)
    for models in ("2", "3"):
        null_streams.main(["--out", str(tmp_path), "--models", models, "--streams", "4", "--first", "7"])
    assert judged == [7, 8, 9] and len(list(tmp_path.iterdir())) == 3
