# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Files shipped with the package: models and configuration, installed under share/push_predictor."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from push_predictor.errors import PushPredictorError

SHIPPED = "default"  # in place of the path of a model: the one that ships with the package
DEFAULT_MODEL = ("resource", "simulated_square_abs.pushmodel")  # of a simulated rig; used unless another model is given


def model_path(model: str | os.PathLike[str]) -> Path:
    """Path of a model file: that of the shipped model for SHIPPED. Raises PushPredictorError if that is missing."""
    return share_path(*DEFAULT_MODEL) if os.fspath(model) == SHIPPED else Path(model)


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
