# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Standard packages of messages that are not on PyPI, for the nodes that a test starts."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path

import pytest


def provide_interfaces(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a package importable in processes started later, or skip the test.

    It is installed, or in the folder that the environment variable PUSH_PREDICTOR_PACKAGE names
    (scripts/install_PACKAGE.sh FOLDER).
    """
    variable = f"PUSH_PREDICTOR_{package.upper()}"
    prefix = os.environ.get(variable)
    if importlib.util.find_spec(package) is None and not prefix:
        pytest.skip(f"{package} is not installed: scripts/install_{package}.sh FOLDER, {variable}=FOLDER")
    if prefix:
        site = Path(prefix, "lib", f"python{sys.version_info.major}.{sys.version_info.minor}", "site-packages")
        for name, folder in (("PYTHONPATH", site), ("LD_LIBRARY_PATH", Path(prefix, "lib"))):
            monkeypatch.setenv(name, os.pathsep.join(filter(None, [str(folder), os.environ.get(name)])))
