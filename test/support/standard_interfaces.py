# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
