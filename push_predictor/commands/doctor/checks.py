# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The checks of `doctor` that need no ROS: Python, packages, compiled modules, model, recording, executables, space."""

from __future__ import annotations

import importlib
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.doctor.findings import Finding
from push_predictor.compiled import REMEDY
from push_predictor.errors import NotCompiledError, PushPredictorError

if TYPE_CHECKING:
    from push_predictor.recordings.rig import Rig
    from push_predictor.recordings.topics import Topics

PYTHON = ((3, 10), (3, 13))
NEEDED = {
    "numpy": "1.24",
    "scipy": "1.10",
    "mcap": "1.1",
    "lz4": "4",
    "zstandard": "0.22",
    "PyYAML": "5.4",
    "threadpoolctl": "3",
}
EXTRAS = {
    "report": (("matplotlib", "jinja2"), "report pages"),
    "live": (("rich",), "progress bars and the live table of the demonstration"),
    "completion": (("argcomplete",), "completion in the shell"),
    "import": (("rosbags", "h5py"), "ROS 1 bags, and `import` of the MIT push data set"),
}
COMPILED = (
    "geometry.boundary",
    "models.mechanics.kernel.surface",
    "models.mechanics.kernel.contact",
    "models.mechanics.kernel.sweep",
    "models.mechanics.kernel.push",
    "models.tabulated.spline",
)
NODES = ("predict_server", "push_recorder", "push_replay", "push_validator")
MODULES = {"PyYAML": "yaml"}
ENOUGH = 200e6  # bytes: a recording of some minutes and a report


def python_and_packages() -> Iterator[Finding]:
    """Check the Python version, the required packages and the extras."""
    yield _python()
    for name, least in NEEDED.items():
        yield _needed(name, least)
    for extra, (names, purpose) in EXTRAS.items():
        yield _extra(extra, names, purpose)


def compiled_modules() -> Finding:
    """Check that every compiled module can be imported."""
    files = []
    for name in COMPILED:
        try:
            files.append(importlib.import_module(f"push_predictor.{name}").__file__)
        except ImportError as error:
            found = f"{name} is not compiled" if isinstance(error, NotCompiledError) else f"{name}: {error}"
            return _broken("compiled", found, "models compute pushes with it", REMEDY)
    return Finding("compiled", "ok", f"{len(files)} modules, the first is {files[0]}")


def model_predicts(given: Path | None) -> Finding:
    """Check that a model file (default: the shipped one) loads and predicts with a valid covariance."""
    try:
        import numpy as np

        from push_predictor.models.store.model_file import load_model
        from push_predictor.resources import DEFAULT_MODEL, share_path

        path = given or share_path(*DEFAULT_MODEL)
        model = load_model(path)
        row = model.examples(1)
        prediction = model.predict_rows(row.inputs, row.duration, row.covariates)
        if not (np.isfinite(prediction.mean).all() and np.linalg.eigvalsh(prediction.covariance[0])[0] > 0.0):
            return _broken("model", f"{path} predicts {prediction.mean[0]}, or an invalid covariance", _OF_A_MODEL)
    except Exception as error:  # an incomplete installation raises exceptions of any kind
        return _broken("model", _words(error), _OF_A_MODEL)
    return Finding("model", "ok", f"{path} loads and predicts ({model.kind}, {len(model.training)} windows)")


def recording_reads(given: Path | None, topics: Topics | None = None, rig: Rig | None = None) -> Finding:
    """Check that a recording (default: a simulated one) can be read and contains pushes."""
    try:
        from push_predictor.recordings.describe import describe_recording
        from push_predictor.recordings.topics import Topics

        with tempfile.TemporaryDirectory(prefix="push_predictor_doctor_") as folder:
            path = given or _simulated(Path(folder))
            found = describe_recording(path, topics or Topics(), rig)
    except Exception as error:  # as above
        return _broken("recording", _words(error), _OF_A_RECORDING)
    source = str(given) if given else "simulated recording"
    if "windows" not in found:
        return _broken("recording", f"{source} has no push_rig record", "no push can be found", "--rig FILE.yaml")
    if not found["windows"]:
        return _broken("recording", f"{source} contains no push", f"push_predictor info {source}")
    return Finding("recording", "ok", f"{source}: {found['pushes']} pushes, {found['windows']} windows")


def executables() -> Finding:
    """Check that the nodes' executables are on PATH or where `ros2 run` looks."""
    paths = {name: shutil.which(name) for name in NODES}
    if all(paths.values()):
        return Finding("executables", "ok", ", ".join(str(path) for path in paths.values()))
    prefixes = [Path(text) for text in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if text]
    for prefix in prefixes:
        if all((prefix / "lib" / "push_predictor" / name).exists() for name in NODES):
            return Finding("executables", "ok", f"in {prefix}: ros2 run push_predictor {NODES[0]}")
    folder = Path(sys.executable).parent
    if all((folder / name).exists() for name in NODES):
        remedy = f"export PATH={folder}:$PATH"
    else:
        remedy = ". install/setup.sh (colcon), or python -m push_predictor.nodes.NAME"
    missing = ", ".join(name for name, path in paths.items() if path is None)
    return Finding(
        "executables", "note", f"{missing}: not on PATH", "the nodes cannot be started by their names", remedy
    )


def space() -> Finding:
    """Check that temporary files can be written, and the free space there."""
    place = tempfile.gettempdir()
    try:
        with tempfile.TemporaryFile() as file:
            file.write(b"0")
        free = shutil.disk_usage(place).free
    except OSError as error:
        return _broken(
            "space", f"{place}: {error.strerror}", "bags and keystores are written there first", "export TMPDIR=FOLDER"
        )
    if free < ENOUGH:
        why = "recordings and reports may not fit"
        return Finding(
            "space", "note", f"{free / 1e6:.0f} MB free in {place}", why, "delete files, or export TMPDIR=FOLDER"
        )
    return Finding("space", "ok", f"{free / 1e9:.1f} GB free in {place}")


_OF_A_MODEL = "predict_server uses it by default"
_OF_A_RECORDING = "training, validation and replay read recordings"


def _python() -> Finding:
    version = ".".join(map(str, sys.version_info[:3]))
    low, high = (".".join(map(str, bound)) for bound in PYTHON)
    if sys.version_info[:2] < PYTHON[0]:
        return _broken("Python", version, f"Python {low} to {high} is required", f"python{high} -m venv .venv")
    if sys.version_info[:2] > PYTHON[1]:
        return Finding("Python", "note", version, f"newer than the tested versions {low} to {high}")
    return Finding("Python", "ok", f"{version}, {sys.executable}")


def _needed(name: str, least: str) -> Finding:
    remedy = f"pip install '{name}>={least}'"
    try:
        importlib.import_module(MODULES.get(name, name))
        version = metadata.version(name)
    except (ImportError, metadata.PackageNotFoundError) as error:
        return _broken(name, f"not found ({error})", "it is required", remedy)
    if _numbers(version) < _numbers(least):
        return _broken(name, version, f"{least} or newer is required", remedy)
    return Finding(name, "ok", version)


def _extra(extra: str, names: tuple[str, ...], purpose: str) -> Finding:
    missing = [name for name in names if not _there(name)]
    if missing:
        found, why = f"not installed: {', '.join(missing)}", f"needed for {purpose}"
        return Finding(f"extra {extra}", "note", found, why, f"pip install {' '.join(missing)}")
    return Finding(f"extra {extra}", "ok", ", ".join(f"{name} {metadata.version(name)}" for name in names))


def _there(name: str) -> bool:
    """Whether its metadata are installed. Importing all packages takes seconds."""
    try:
        return bool(metadata.version(name))
    except metadata.PackageNotFoundError:
        return False


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r"\d+", version)[:3])


def _simulated(folder: Path) -> Path:
    import numpy as np

    from push_predictor.recordings.write import write_recording
    from push_predictor.simulation.pushes import random_pushes
    from push_predictor.simulation.rig_simulator import SimulationSpec, simulate

    plan = random_pushes(2, [0.05], 0.03, np.random.default_rng(0))
    write_recording(folder / "two_pushes", simulate(SimulationSpec("rect1", "abs", plan, name="two_pushes")))
    return folder / "two_pushes"


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, (PushPredictorError, OSError)) else f"{type(error).__name__}: {error}"


def _broken(name: str, found: str, why: str, remedy: str = "") -> Finding:
    return Finding(name, "missing", " ".join(found.split()), why, remedy)
