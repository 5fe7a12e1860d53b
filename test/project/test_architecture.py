# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The direction of imports, and what needs ROS: docs/architecture.md and its picture, checked against the code."""

from __future__ import annotations

import ast
import runpy
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from repository import REPOSITORY

ROS = ("rclpy", "rcl_interfaces", "push_predictor_interfaces", "launch", "ament_index_python")

PACKAGE = REPOSITORY / "push_predictor"
ROOMS = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
LIBRARY = sorted(ROOMS - {"nodes"})
MOST_MODULES = 15


@pytest.fixture(scope="module")
def picture() -> list[list[str]]:
    """The rooms of each row."""
    rows = runpy.run_path(str(REPOSITORY / "docs" / "pictures" / "draw_architecture.py"))["ROWS"]
    return [[room for box in row for room in box[0].split(", ")] for row in rows[1:]]  # the first row is outside


@cache
def imports_of(path: Path) -> set[str]:
    """Modules that a file imports, and what it imports from them: a.b and a.b.c for `from a.b import c`."""
    named: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            named |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            named |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return named


def files_of(room: str) -> list[Path]:
    """The modules of a room: a package or a module of push_predictor, or msg_adapters."""
    if (PACKAGE / f"{room}.py").is_file():
        return [PACKAGE / f"{room}.py"]
    return sorted((REPOSITORY / room if room == "msg_adapters" else PACKAGE / room).rglob("*.py"))


def imports_room(names: set[str], room: str) -> bool:
    module = room if room == "msg_adapters" else f"push_predictor.{room}"
    return any(f"{name}.".startswith(f"{module}.") for name in names)


def modules(package: str) -> list[Path]:
    return sorted((PACKAGE / package).rglob("*.py"))


@pytest.mark.parametrize(
    ("packages", "forbidden"),
    [
        (LIBRARY, (*ROS, "msg_adapters")),
        ([*(room for room in LIBRARY if room != "commands"), "nodes"], ("push_predictor_paper",)),
        (["simulation"], ("push_predictor.models", "push_predictor.evaluation")),
    ],
    ids=["no ROS in the library", "only commands know the paper", "the simulator knows no model"],
)
def test_what_may_not_be_imported(packages: list[str], forbidden: tuple[str, ...]) -> None:
    for path in (path for package in packages for path in modules(package)):
        for name in imports_of(path):
            assert not name.startswith(forbidden) and ("rclpy" not in forbidden or "_msgs" not in name), (path, name)


def test_the_picture_shows_every_room(picture: list[list[str]]) -> None:
    assert {room for row in picture for room in row} == ROOMS | {"api", "msg_adapters"}


def test_imports_point_down_or_right_in_the_picture(picture: list[list[str]]) -> None:
    for height, row in enumerate(picture):
        for place, room in enumerate(row):
            forbidden = [*(above for rows in picture[:height] for above in rows), *row[:place]]
            for path in files_of(room):
                names = imports_of(path)
                assert not [other for other in forbidden if imports_room(names, other)], path


@pytest.mark.parametrize("room", ["models", "recordings", "residuals", "nodes", "evaluation"])
def test_no_two_folders_of_a_room_import_each_other(room: str) -> None:
    folders = sorted(path.parent.name for path in (PACKAGE / room).glob("*/__init__.py"))
    arrows = {
        (folder, other)
        for folder in folders
        for path in modules(f"{room}/{folder}")
        for other in folders
        if other != folder and imports_room(imports_of(path), f"{room}.{other}")
    }
    assert not [arrow for arrow in arrows if arrow[::-1] in arrows]


def test_folders_of_models_import_only_from_those_before_them_and_mechanics_no_regression() -> None:
    order = ["gaussian_process", "mechanics", "effects", "predictors", "tabulated", "store"]
    assert sorted(order) == sorted(path.parent.name for path in (PACKAGE / "models").glob("*/__init__.py"))
    for k, folder in enumerate(order):
        forbidden = [*order[k + 1 :], *(order[:k] if folder == "mechanics" else ())]
        for path in modules(f"models/{folder}"):
            assert not [other for other in forbidden if imports_room(imports_of(path), f"models.{other}")], path


@pytest.mark.parametrize("product", ["push_predictor", "msg_adapters", "push_predictor_paper/push_predictor_paper"])
def test_no_folder_has_more_modules_than_one_can_survey(product: str) -> None:
    for package in (REPOSITORY / product).rglob("__init__.py"):
        found = [path for path in package.parent.glob("*.py") if path != package]
        assert len(found) <= MOST_MODULES, package.parent


# --- the paths of data in docs/architecture.md ------------------------------------------------------------------------


def imports(one: str, two: str) -> bool:
    """Whether a module imports another; paths below push_predictor, or of msg_adapters."""
    return module_name(two) in imports_of(located(one))


def located(module: str) -> Path:
    return REPOSITORY / module if module.startswith("msg_adapters/") else PACKAGE / module


def module_name(module: str) -> str:
    return ".".join(located(module).relative_to(REPOSITORY).with_suffix("").parts)


# --- what may be imported where --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_node_starts_without_what_it_needs_later_or_never() -> None:
    """Slow packages of scipy take 0.6 s to import: no node needs an optimiser or scipy.stats (normal_scores).

    The server needs matrices and special functions for a push outside the table, and readers of recordings for a trace.
    """
    slow = {"scipy.stats", "scipy.optimize", "scipy.interpolate", "scipy.spatial"}
    late = {"scipy.special", "scipy.linalg", "threadpoolctl", "multiprocessing", "mcap", "csv", "sqlite3"}
    nodes = {"predict_server": slow | late, "push_recorder": slow, "push_replay": slow, "push_validator": slow}
    check = (
        "import importlib, sys; from push_predictor.blas_threads import limit_process; limit_process()\n"
        f"for node, unwanted in {nodes}.items():\n"
        "    importlib.import_module(f'push_predictor.nodes.{node}')\n"
        "    if found := unwanted & sys.modules.keys(): sys.exit(f'{node}: {found}')\n"
    )
    subprocess.run([sys.executable, "-c", check], check=True, cwd=REPOSITORY)


@pytest.mark.slow
def test_models_are_learnt_and_used_where_there_is_no_ros() -> None:
    forbidden = "import sys; sys.modules.update(dict.fromkeys(['rclpy', 'matplotlib', 'rosbags', 'h5py', 'rich']))\n"
    use = (
        "import push_predictor.models.train, push_predictor.models.store.model_file, push_predictor.recordings.load\n"
        "import push_predictor.recordings.importers, push_predictor.evaluation.offline\n"
        "import push_predictor.simulation.rig_simulator, push_predictor.cli\n"
        "push_predictor.cli.build_parser()\n"
    )
    subprocess.run([sys.executable, "-c", forbidden + use], check=True, cwd=REPOSITORY)


# --- the way of a message --------------------------------------------------------------------------------------------

MADE_BY = {"Samples": ("StreamDecoder", "take")}  # a call that returns one need not name its class


@cache
def drawn() -> dict[str, Any]:
    return runpy.run_path(str(REPOSITORY / "docs" / "pictures" / "draw_message.py"))


@cache
def names_in(path: Path) -> tuple[set[str], set[str]]:
    """What a module defines at its top, and what its code names, without its imports."""
    tree = ast.parse(path.read_text())
    defined = {node.name for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    named = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    named |= {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    named |= {made for made, by in MADE_BY.items() if {*by} <= named}
    return defined, named


@pytest.mark.parametrize("name", drawn()["BOXES"])
def test_every_box_of_the_way_of_a_message_is_a_class_or_a_function(name: str) -> None:
    assert any(name in names_in(path)[0] for room in ("recordings", "online", "nodes") for path in modules(room))


@pytest.mark.parametrize(("one", "two"), drawn()["ARROWS"])
def test_every_arrow_of_the_way_of_a_message_is_in_the_code(one: str, two: str) -> None:
    """One uses the other, or a third module hands over from one to the other."""
    assert any({one, two} <= set().union(*names_in(path)) for path in PACKAGE.rglob("*.py"))
    assert drawn()["BOXES"][one][1] < drawn()["BOXES"][two][1], "it points down"


def test_the_way_of_a_message_begins_at_a_bag_and_a_device_and_ends_at_the_table() -> None:
    arrows = drawn()["ARROWS"]
    begins, ends = {one for one, _ in arrows}, {two for _, two in arrows}
    assert begins - ends == {"open_bag", "FollowingSubscription"} and "windows_to_table" in ends - begins
    assert begins | ends == {*drawn()["BOXES"]}
    for made, (maker, method) in MADE_BY.items():
        assert f"def {method}(self, last: bool = False) -> {made}:" in next(
            path.read_text() for path in PACKAGE.rglob("*.py") if maker in names_in(path)[0]
        )
