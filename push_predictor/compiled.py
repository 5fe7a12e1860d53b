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

"""Refuses a module that should have been compiled and was not: as Python it would be more than ten times slower."""

from __future__ import annotations

import sys

from push_predictor.errors import NotCompiledError

REMEDY = "`pip install -e .` in its folder (needs a C compiler), or build it with colcon"


def require_compiled(file: str) -> None:
    """Raise NotCompiledError if the module of this file is Python code. Called before the module imports `cython`."""
    if file.endswith(".py"):
        version = ".".join(map(str, sys.version_info[:2]))
        raise NotCompiledError(
            f"the compiled mechanics of push_predictor are missing ({file}, Python {version}): run {REMEDY}"
        )
