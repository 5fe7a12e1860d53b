# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models of planar pushing, learnt from recorded pushes: what a push does, and how certain that is.

The names below are the public Python interface. Each is imported when it is first used, so that importing the package
takes milliseconds.

    from push_predictor import Pushes, train, validate

    model = train("bags/square_abs_train")
    print(model.predict(Pushes(velocity=0.02, contact=0.1, angle=0.3)))
    print(validate(model, "bags/square_abs_test"))
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from push_predictor.adaptation.adaptation import Adaptation
    from push_predictor.api import Validation, choose_push, find_windows, trace, train, validate
    from push_predictor.design.batch import suggest_pushes
    from push_predictor.design.limits import Limits
    from push_predictor.errors import DataWarning
    from push_predictor.models.push_model import PushModel
    from push_predictor.models.pushes import Pushes
    from push_predictor.models.store.model_file import load_model
    from push_predictor.planning.goal import Goal
    from push_predictor.recordings.read import read_recording
    from push_predictor.recordings.topics import Topics

_PLACES = {
    "Adaptation": "adaptation.adaptation",
    "DataWarning": "errors",
    "Goal": "planning.goal",
    "Limits": "design.limits",
    "PushModel": "models.push_model",
    "Pushes": "models.pushes",
    "Topics": "recordings.topics",
    "Validation": "api",
    "choose_push": "api",
    "find_windows": "api",
    "load_model": "models.store.model_file",
    "read_recording": "recordings.read",
    "suggest_pushes": "design.batch",
    "trace": "api",
    "train": "api",
    "validate": "api",
}

__all__ = [
    "Adaptation",
    "DataWarning",
    "Goal",
    "Limits",
    "PushModel",
    "Pushes",
    "Topics",
    "Validation",
    "__version__",
    "choose_push",
    "find_windows",
    "load_model",
    "read_recording",
    "suggest_pushes",
    "trace",
    "train",
    "validate",
]


def __getattr__(name: str) -> object:
    """Import a public name on first use (PEP 562)."""
    if name not in _PLACES:
        raise AttributeError(f"module 'push_predictor' has no attribute {name!r}")
    found: object = getattr(import_module(f"push_predictor.{_PLACES[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return __all__
