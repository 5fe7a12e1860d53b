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

"""Files shipped with the package: models and configuration, installed under share/push_predictor."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from push_predictor.errors import PushPredictorError

SHIPPED = "default"  # in place of the path of a model: the one that ships with the package
DEFAULT_MODEL = ("resource", "simulated_square_abs.pushmodel")  # of a simulated rig; used unless another model is given


def share_path(*parts: str) -> Path:
    """Path of a shipped file, in the checkout or where colcon or pip installed it.

    Raises PushPredictorError, which lists the places searched, if it is in none of them.
    """
    prefixes = filter(None, [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix])
    places = [
        Path(__file__).resolve().parents[1],
        *(Path(prefix) / "share" / "push_predictor" for prefix in prefixes),
    ]
    for place in places:
        if (found := place.joinpath(*parts)).is_file():
            return found
    raise PushPredictorError(f"{'/'.join(parts)}: not found in {', '.join(map(str, places))}, install the package")
