"""Which way imports point, and what needs ROS: the picture in docs/architecture.md, checked."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from repository import REPOSITORY

LAYERS = [
    "geometry",
    "recordings",
    "replay",
    "models",
    "planning",
    "reporting",
    "evaluation",
    "residuals",
    "online",
    "nodes",
]
ROS = ("rclpy", "rcl_interfaces", "push_predictor_interfaces", "launch", "ament_index_python")


def imports_of(path: Path) -> set[str]:
    tree = ast.parse(path.read_text())
    named = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    return named | {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}


def modules(package: str) -> list[Path]:
    return sorted((REPOSITORY / "push_predictor" / package).rglob("*.py"))


@pytest.mark.parametrize("package", [*LAYERS[:-1], "simulation", "commands"])
def test_the_library_imports_no_ros(package: str) -> None:
    for path in modules(package):
        for name in imports_of(path):
            assert not name.startswith((*ROS, "msg_adapters")) and "_msgs" not in name, f"{path}: {name}"


@pytest.mark.parametrize("package", LAYERS)
def test_imports_point_one_way(package: str) -> None:
    later = LAYERS[LAYERS.index(package) + 1 :]
    for path in modules(package):
        for name in imports_of(path):
            assert not name.startswith(tuple(f"push_predictor.{layer}" for layer in later)), f"{path}: {name}"


@pytest.mark.parametrize("package", [*LAYERS, "simulation"])
def test_only_commands_know_the_paper(package: str) -> None:
    for path in modules(package):
        assert not any(name.startswith("push_predictor_paper") for name in imports_of(path)), path


def test_the_simulator_knows_no_model() -> None:
    for path in modules("simulation"):
        for name in imports_of(path):
            assert not name.startswith(("push_predictor.models", "push_predictor.evaluation")), f"{path}: {name}"


@pytest.mark.parametrize("node", ["predict_server", "push_replay", "push_validator"])
def test_a_node_starts_without_scipy_stats(node: str) -> None:
    """It takes 0.4 s to import; the nodes need one small function of it, which push_predictor.normal_scores has."""
    check = f"import sys, push_predictor.nodes.{node}; sys.exit('scipy.stats' in sys.modules)"
    subprocess.run([sys.executable, "-c", check], check=True, cwd=REPOSITORY)


def test_models_are_learnt_and_used_where_there_is_no_ros() -> None:
    forbidden = "import sys; sys.modules.update(dict.fromkeys(['rclpy', 'matplotlib', 'rosbags', 'h5py', 'rich']))\n"
    use = (
        "import push_predictor.models.train, push_predictor.models.store.model_file, push_predictor.recordings.load\n"
        "import push_predictor.recordings.importers, push_predictor.evaluation.offline\n"
        "import push_predictor.simulation.rig_simulator, push_predictor.cli\n"
        "push_predictor.cli.build_parser()\n"
    )
    subprocess.run([sys.executable, "-c", forbidden + use], check=True, cwd=REPOSITORY)


def test_versions_agree() -> None:
    version = (REPOSITORY / "package.xml").read_text().split("<version>")[1].split("<")[0]
    assert f'__version__ = "{version}"' in (REPOSITORY / "push_predictor" / "__init__.py").read_text()
    assert f'version="{version}"' in (REPOSITORY / "setup.py").read_text()
    assert f"## {version}" in (REPOSITORY / "CHANGELOG.md").read_text()
