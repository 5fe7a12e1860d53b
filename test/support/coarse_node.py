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

"""`python coarse_node.py EXECUTABLE --ros-args ...` runs a node whose reports have coarse pictures.

So it is in the processes that it starts: multiprocessing runs this file in each of them, but for its end.
"""

from __future__ import annotations

import sys
from contextlib import ExitStack
from importlib import import_module

from coarse_pictures import coarse_pictures

from push_predictor.nodes.entry import install_handlers

ALL_THE_TIME = ExitStack()
ALL_THE_TIME.enter_context(coarse_pictures())

if __name__ == "__main__":
    install_handlers()
    sys.exit(import_module(f"push_predictor.nodes.{sys.argv.pop(1)}").main())
