# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Modules that Cython compiles: how setup.py builds and ships them, and what happens where they are not compiled."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest
from repository import REPOSITORY

from push_predictor.commands.doctor_command import COMPILED
from push_predictor.compiled import REMEDY
from push_predictor.errors import NotCompiledError

SOURCES = [REPOSITORY / "push_predictor" / f"{name.replace('.', '/')}.py" for name in COMPILED]
HIDE_CYTHON = "import sys\nsys.modules.update(Cython=None, cython=None)\n"
HIDE_COMPILED = f"""
import sys
from importlib.util import spec_from_file_location
class Finder:
    def find_spec(name, path=None, target=None):
        if name in {[f"push_predictor.{name}" for name in COMPILED]}:
            return spec_from_file_location(name, {str(REPOSITORY)!r} + "/" + name.replace(".", "/") + ".py")
sys.meta_path.insert(0, Finder)
"""


def python(*words: str, first: str, folder: Path, patience: float = 60.0) -> subprocess.CompletedProcess[str]:
    """Run Python in the repository, with code that runs before anything else."""
    (folder / "sitecustomize.py").write_text(first)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(REPOSITORY)])}
    command = [sys.executable, *words]
    return subprocess.run(command, env=environment, cwd=REPOSITORY, capture_output=True, text=True, timeout=patience)


# --- setup.py --------------------------------------------------------------------------------------------------------


def test_source_distribution_has_the_sources_of_compiled_modules_and_no_product(tmp_path: Path):
    """Also where Cython is missing: colcon asks setup.py for the package's name before anything is built."""
    command = ("setup.py", "-q", "egg_info", "--egg-base", str(tmp_path))
    done = python(*command, first=HIDE_CYTHON, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    (about,) = tmp_path.glob("*.egg-info/PKG-INFO")
    (listed,) = tmp_path.glob("*.egg-info/SOURCES.txt")
    assert {"Name: push_predictor", "Version: 0.1.0"} <= set(
        about.read_text().replace("push-predictor", "push_predictor").splitlines()
    )
    files = {Path(line) for line in listed.read_text().splitlines()}
    sources = {path.relative_to(REPOSITORY) for path in SOURCES}
    declarations = {path.relative_to(REPOSITORY) for path in (REPOSITORY / "push_predictor").rglob("*.pxd")}
    assert sources | declarations <= files and len(declarations) > 2
    assert not [path for path in files if path.suffix in {".c", ".so", ".o"} or "build" in path.parts]


def test_build_without_cython_ends_with_the_remedy_in_one_line(tmp_path: Path):
    folders = ("--build-lib", str(tmp_path / "lib"), "--build-temp", str(tmp_path / "temp"))
    done = python("setup.py", "-q", "build_ext", *folders, first=HIDE_CYTHON, folder=tmp_path)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert "Cython 3 is needed to build: apt install cython3, or pip install" in done.stderr.splitlines()[-1]


@pytest.mark.long
def test_build_puts_c_files_into_the_temporary_folder_and_modules_next_to_their_package(tmp_path: Path):
    if find_spec("Cython") is None:
        pytest.skip("Cython is not installed")
    before = set(REPOSITORY.rglob("push_predictor/**/*.c"))
    done = python(
        "setup.py", "-q", "build", "--build-base", str(tmp_path / "build"), first="", folder=tmp_path, patience=900.0
    )
    assert done.returncode == 0, done.stderr
    assert set(REPOSITORY.rglob("push_predictor/**/*.c")) == before == set()
    (built,) = (tmp_path / "build").glob("lib*")
    code = f"import push_predictor.{', push_predictor.'.join(COMPILED)}; print(push_predictor.__file__)"
    environment = {**os.environ, "PYTHONPATH": str(built)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=60.0
    )
    assert done.returncode == 0 and str(built) in done.stdout, done.stderr


# --- where they are not compiled -------------------------------------------------------------------------------------


@pytest.mark.parametrize("cython", [None, ModuleType("cython")])
@pytest.mark.parametrize("path", SOURCES, ids=COMPILED)
def test_module_that_is_not_compiled_refuses_with_the_remedy(
    path: Path, cython: ModuleType | None, monkeypatch: pytest.MonkeyPatch
):
    """Whether Cython is installed or not: with it, the module would run as slow Python."""
    monkeypatch.setitem(sys.modules, "cython", cython)
    with pytest.raises(NotCompiledError) as refused:
        runpy.run_path(str(path))
    assert isinstance(refused.value, ImportError)
    message = str(refused.value)
    assert str(path) in message and message.endswith(f": run {REMEDY}") and "\n" not in message


SIMULATE = (
    "push_predictor.cli",
    "simulate",
    "--shape",
    "rect1",
    "--surface",
    "abs",
    "--pushes",
    "2",
    "--speed",
    "0.05",
)


@pytest.mark.parametrize(
    ("words", "who"),
    [
        ((*SIMULATE, "--out", "never"), "push_predictor simulate"),
        pytest.param(("push_predictor.nodes.predict_server",), "predict_server", marks=pytest.mark.ros),
    ],
)
def test_command_or_node_without_compiled_modules_prints_one_line(words: tuple[str, ...], who: str, tmp_path: Path):
    done = python("-m", *words, first=HIDE_COMPILED, folder=tmp_path)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 1 and line.startswith(f"{who}: the compiled mechanics") and line.endswith(REMEDY)
