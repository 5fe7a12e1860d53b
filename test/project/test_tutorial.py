# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The tutorial's code runs as it stands, from top to bottom, and prints what its text states."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from repository import BAGS, REPOSITORY

PAGE = REPOSITORY / "docs" / "tutorial.md"
MOST_LINES = 60


def code() -> str:
    """All Python blocks of the page, in order."""
    return "\n".join(re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL))


@pytest.mark.long
def test_the_code_runs_from_a_bag_to_a_choice(tmp_path: Path):
    (tmp_path / "bags").symlink_to(BAGS)
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    done = subprocess.run(
        [sys.executable, "-c", code()], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0 and "Warning" not in done.stderr, done.stderr
    for part in ("trained on 300 windows", "(3, 3) (3, 3) (3, 3, 3)", "603 windows of 120 pushes", "Choice: contact"):
        assert part in done.stdout, part
    assert done.stdout.rstrip().endswith("square_abs_train")
    assert (tmp_path / "rotation.png").stat().st_size > 10_000


def test_the_code_is_short_and_uses_the_public_interface_only():
    lines = [line for line in code().splitlines() if line.strip()]
    assert len(lines) <= MOST_LINES
    assert not re.findall(r"from push_predictor\.", code())
