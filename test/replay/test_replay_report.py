# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report of a replay: its summary and its diagnostics."""

from __future__ import annotations

import pytest

from push_predictor.replay.report import LAST, Delays, Lateness, ReplayReport

REPORT = ReplayReport("bag", "finished", 2.0, 7, Delays(1.0, 2.0, 3.0), behind=0.0, lost=0, acknowledged=True)


def test_percentiles_are_those_of_the_last_messages_and_the_maximum_is_that_of_all() -> None:
    lateness = Lateness()
    assert lateness.delays() == Delays(0.0, 0.0, 0.0)
    lateness.add(7_000_000)
    for late in range(LAST):
        lateness.add(late - 10)
    found = lateness.delays()
    assert found.p50 == pytest.approx(LAST / 2000.0, rel=1e-3) and found.p99 == pytest.approx(LAST * 0.99e-3, rel=1e-3)
    assert found.maximum == 7000.0


def test_the_summary_states_the_delay() -> None:
    assert REPORT.summary == (
        "finished: published 7 messages of bag at rate 2, late p50 1 us, p99 2 us, max 3 us, lost 0, acknowledged yes"
    )


def test_the_diagnostics_have_each_delay_under_its_name() -> None:
    late = {name: value for name, value in REPORT.values.items() if name.startswith("late")}
    assert late == {
        "late_p50_us": "1.0",
        "late_p99_us": "2.0",
        "late_max_us": "3.0",
    }
