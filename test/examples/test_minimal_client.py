# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The planner's client of README runs as it stands and prints what README says."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytest.importorskip("rclpy")
import ros_harness as harness
from repository import REPOSITORY

pytestmark = pytest.mark.ros
CLIENT = REPOSITORY / "examples" / "minimal_client.py"


def test_readme_quotes_the_client_and_what_it_prints() -> None:
    readme, code = (REPOSITORY / "README.md").read_text(), CLIENT.read_text()
    assert code[code.index("import numpy") :] in readme
    with harness.reserved_domain() as domain, harness.node_process("predict_server", domain=domain):
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "PYTHONPATH": str(REPOSITORY)}
        done = subprocess.run([sys.executable, CLIENT], env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert f"prints `{done.stdout.strip()}`" in readme
