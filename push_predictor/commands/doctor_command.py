# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor doctor: check that the installation imports, predicts and creates a node."""

from __future__ import annotations

import argparse
import importlib
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass

from push_predictor import __version__
from push_predictor.commands.common.command import command
from push_predictor.commands.common.output import write_json
from push_predictor.commands.common.progress import progress
from push_predictor.compiled import REMEDY
from push_predictor.errors import PushPredictorError

REQUIRED = ("numpy", "scipy", "mcap", "lz4", "zstandard", "yaml")
OPTIONAL = {"threadpoolctl": "a program that imports numpy first uses many threads for small matrices, slowly"}
COMPILED = (
    "geometry.boundary",
    "models.mechanics.kernel.surface",
    "models.mechanics.kernel.contact",
    "models.mechanics.kernel.sweep",
    "models.mechanics.kernel.push",
    "models.tabulated.spline",
)
INSTALL = "pip install ."
INSTALL_ROS = "pip install 'ros-jazzy-rclpy[fastrtps]' ./push_predictor_interfaces, or . install/setup.sh"
PATIENCE = 90.0  # s that a middleware may take to create a node


@dataclass(frozen=True)
class Finding:
    """Result of one check; remedy: how to fix it, as a command where possible, empty if all is well."""

    name: str
    state: str  # ok or missing
    found: str
    remedy: str = ""

    @property
    def lines(self) -> list[str]:
        """Lines to print: the finding, and how to fix it."""
        remedy = [f"{'':22s}-> {self.remedy}"] if self.remedy else []
        return [f"{self.state:8s} {self.name:12s} {self.found}", *remedy]


@command(
    "doctor",
    "Check this installation. Imports packages and compiled modules, predicts one push, and creates a ROS node.",
    "push_predictor doctor --json -",
)
def run(options: argparse.Namespace) -> None:
    """Run all checks and print the findings. Raises PushPredictorError that names what is missing."""
    with progress("doctor"):
        findings = [
            _checked("packages", _packages, INSTALL),
            compiled_modules(),
            _checked("prediction", _prediction, INSTALL),
            ros_node(),
        ]
    missing = [finding.name for finding in findings if finding.state == "missing"]
    python = ".".join(map(str, sys.version_info[:3]))
    content = {"version": __version__, "python": python, "sound": not missing, "checks": list(map(asdict, findings))}
    if not write_json(options, content):
        print(f"push_predictor {__version__}, Python {python}, {sys.executable}")
        for finding in findings:
            print("\n".join(finding.lines))
    if missing:
        raise PushPredictorError(f"missing or broken: {', '.join(missing)}")


def compiled_modules() -> Finding:
    """Check that every compiled module can be imported."""
    return _checked("compiled", _compiled, REMEDY)


def ros_node() -> Finding:
    """Check that a node can be created, in a process of its own: a middleware may hang or crash."""
    command = [sys.executable, "-m", "push_predictor.nodes.network_security"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        return Finding("ROS", "missing", f"no result within {PATIENCE:.0f} s", INSTALL_ROS)
    if done.returncode == 0:
        return Finding("ROS", "ok", done.stdout.strip())
    last = (done.stderr.strip().splitlines() or ["no message"])[-1]
    return Finding("ROS", "missing", f"ended with status {done.returncode}: {last}", INSTALL_ROS)


def _prediction() -> str:
    """Predict one push with the shipped model. Raises PushPredictorError unless the covariance is valid."""
    import numpy as np

    from push_predictor.models.store.model_file import load_model
    from push_predictor.resources import DEFAULT_MODEL, share_path

    path = share_path(*DEFAULT_MODEL)
    model = load_model(path)
    push = model.examples(1)
    prediction = model.predict_rows(push.inputs, push.duration, push.covariates)
    if not (np.isfinite(prediction.mean).all() and np.linalg.eigvalsh(prediction.covariance[0])[0] > 0.0):
        raise PushPredictorError(f"{path} predicts {prediction.mean[0]}, or an invalid covariance")
    return f"{path} loads and predicts"


def _compiled() -> str:
    modules = [importlib.import_module(f"push_predictor.{name}") for name in COMPILED]
    return f"{len(modules)} modules, the first is {modules[0].__file__}"


def _packages() -> str:
    modules = [importlib.import_module(name) for name in REQUIRED]
    notes = []
    for name, without in OPTIONAL.items():
        try:
            modules.append(importlib.import_module(name))
        except ImportError:
            notes.append(f"without {name} {without}")
    versions = [f"{module.__name__} {getattr(module, '__version__', '')}".rstrip() for module in modules]
    return "; ".join([", ".join(versions), *notes])


def _checked(name: str, check: Callable[[], str], remedy: str) -> Finding:
    try:
        return Finding(name, "ok", check())
    except Exception as error:  # an incomplete installation raises exceptions of any kind
        words = str(error) if isinstance(error, (PushPredictorError, OSError)) else f"{type(error).__name__}: {error}"
        return Finding(name, "missing", " ".join(words.split()), remedy)
