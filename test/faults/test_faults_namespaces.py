# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Two robots in one domain: server, validator and replay in two namespaces stay independent."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest
from ros_harness import acquaint, call, free_domain, node_process, ros_context
from validator_bench import CIRCLE, HEXAGON, WRITTEN, Status, assert_same_as_offline, replaying, windows_of

from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor_interfaces.srv import Resume

CELLS = {"/cell1": HEXAGON, "/cell2": CIRCLE}


@pytest.mark.long
def test_each_validator_scores_its_own_robot_with_its_own_server(tmp_path: Path) -> None:
    """Both request a model by the same name, which is a different model in each cell; both replays run at once."""
    domain, models, outputs = free_domain(), dict[str, Path](), dict[str, Path]()
    with ExitStack() as stack:
        node, processes = stack.enter_context(ros_context(domain)), []
        for cell, recording in CELLS.items():
            models[cell], outputs[cell] = (tmp_path / f"{cell[1:]}{end}" for end in (".pushmodel", ""))
            table, rig, few = load_data([recording]), load_rig_for([recording]), TrainingOptions(30, mean="zero")
            save_model(train_model(table, rig, "gp", name="robot", options=few), models[cell])
            params = {"model": "robot", "output": outputs[cell], "report": False, "diagnostics_period": 0.2}
            started = {"predict_server": {"models": [str(models[cell])]}, "push_validator": params}
            for name, given in started.items():
                process = stack.enter_context(node_process(name, domain=domain, namespace=cell, params=given))
            processes.append(process)
            paused = {"play.start_paused": True}
            stack.enter_context(replaying(domain, "-r", f"__ns:={cell}", recording=recording, **paused))
        statuses = {cell: Status(node, f"{cell}/push_validator") for cell in CELLS}
        for cell in CELLS:
            acquaint(node, f"{cell}/push_replay")
            call(node.create_client(Resume, f"{cell}/push_replay/resume"), Resume.Request())
        for process in processes:
            process.wait_for_text(WRITTEN, 120.0)
        for cell, status in statuses.items():
            status.wait_for("robot windows", str(len(windows_of(outputs[cell]))))
            assert status.identity == (f"{cell}/push_validator: validation", load_rig_for([CELLS[cell]]).shape)
    for cell, recording in CELLS.items():
        assert_same_as_offline(outputs[cell], models[cell], recording)
