"""Where the model that ships with the package lies: a simulated rig's, for a server that nobody has given a model."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from push_predictor.errors import ModelFileError

DEFAULT_MODEL = "simulated_square_abs.pushmodel"
_SHARE = Path("share", "push_predictor", "resource")


def default_model_path() -> Path:
    """The shipped model file: of the installed package (pip, colcon), else of the source tree.

    Raises ModelFileError where there is none.
    """
    looked = [folder / DEFAULT_MODEL for folder in _folders()]
    for path in looked:
        if path.is_file():
            return path
    raise ModelFileError(f"the shipped model is not in {', '.join(str(path.parent) for path in looked)}")


def _folders() -> Iterator[Path]:
    yield Path(__file__).resolve().parents[2] / "resource"
    yield from (Path(prefix) / _SHARE for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix)
    yield Path(sys.prefix) / _SHARE
