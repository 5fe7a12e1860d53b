"""The table of the alarm's benchmark: what counts as false, as detected, and as late."""

from __future__ import annotations

from benchmarks.blind.alarm import Row, markdown_of


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
