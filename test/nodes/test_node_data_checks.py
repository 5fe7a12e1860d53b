# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_replay and push_validator report the mistakes of what they play and receive, on /diagnostics and in the log."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from checks_in_process import checking_in_this_process
from diagnostic_msgs.msg import DiagnosticStatus
from hosted_nodes import hosted_node
from mistakes import force_turned
from ros_harness import free_domain, ros_context
from validator_bench import HEXAGON, Status, beginning

from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import train_model
from push_predictor.online.alarm_process import AlarmProcess
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.write import write_recording

pytestmark = pytest.mark.slow


def test_a_force_of_the_wrong_sign_is_reported_by_both_nodes(tmp_path: Path) -> None:
    """As a warning by the one, as an error by the other, which is strict."""
    some = beginning(HEXAGON, 12.5, tmp_path / "right")  # more than the 1000 poses of a first check
    write_recording(tmp_path / "wrong", force_turned(read_recording(some), np.pi))
    model = train_model(load_data([some]), load_rig_for([some]), "analytical", name="analytical")
    save_model(model, tmp_path / "analytical.pushmodel")
    domain = free_domain()
    params = {"model": tmp_path / "analytical.pushmodel", "diagnostics_period": 0.2, "strict": True}
    without_alarm = patch.object(AlarmProcess, "prepare")
    with (
        without_alarm,
        checking_in_this_process(),
        ros_context(domain) as node,
        hosted_node("push_validator", domain=domain, params=params),
    ):
        received, played = Status(node), Status(node, "push_replay")
        received.wait_for_first()
        played_wrong = {"recording": tmp_path / "wrong", "play.rate": 10.0, "wait_for_subscribers": 60.0}
        with hosted_node("push_replay", domain=domain, params=played_wrong) as replay:
            for status in (received, played):
                status.wait_for_message("change the sign", 120.0)
            assert (received.values["data check"], played.values["data_check"]) == ("wrench_sign", "wrench_sign")
            assert received.identity == ("/push_validator: validation", "hex")
            assert played.identity == ("/push_replay: replay", "wrong")
            assert (received.all[-1][0], played.all[-1][0]) == (DiagnosticStatus.ERROR, DiagnosticStatus.WARN)
            told = [line for line in replay.text().splitlines() if "change the sign" in line]
            of_replay = [line for line in told if "[push_replay]" in line and "finished: published" not in line]
            assert len(of_replay) == 1, "the end repeats it"
        assert any("[push_validator]" in line for line in told)
