# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report of a replay: its summary and its diagnostics."""

from __future__ import annotations

from push_predictor.replay.lateness import Delays
from push_predictor.replay.report import ReplayReport

REPORT = ReplayReport(
    "bag", "finished", 2.0, 7, Delays(1.0, 2.0, 3.0), Delays(40.0, 50.0, 60.0), behind=0.0, lost=0, acknowledged=True
)


def test_the_summary_states_the_delay_before_and_after_publishing() -> None:
    assert REPORT.summary == (
        "finished: published 7 messages of bag at rate 2, late p50 1 us, p99 2 us, max 3 us, "
        "after publishing p50 40 us, p99 50 us, max 60 us, lost 0, acknowledged yes"
    )


def test_the_diagnostics_have_each_delay_under_its_name() -> None:
    late = {name: value for name, value in REPORT.values.items() if name.startswith("late")}
    assert late == {
        "late_p50_us": "1.0",
        "late_p99_us": "2.0",
        "late_max_us": "3.0",
        "late_after_p50_us": "40.0",
        "late_after_p99_us": "50.0",
        "late_after_max_us": "60.0",
    }
