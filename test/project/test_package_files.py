# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The files that ROS's tools read, and the commands for an apt Jazzy: the tools, packages and arguments exist."""

from __future__ import annotations

import ast
import os
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml
from catkin_pkg.changelog import get_changelog_from_path
from catkin_pkg.package import Package, parse_package
from fake_launch import install_fake_launch, load_launch_file
from repository import REPOSITORY

import push_predictor
from push_predictor.cli import build_parser
from push_predictor.commands import doctor_command
from push_predictor.resources import SHIPPED

FOLDERS = {
    "push_predictor": REPOSITORY,
    "push_predictor_interfaces": REPOSITORY / "push_predictor_interfaces",
    "push_predictor_paper": REPOSITORY / "push_predictor_paper",
}
KEYS = yaml.safe_load((REPOSITORY / "scripts" / "rosdep_local.yaml").read_text())
KEY_OF = {  # of imports that are not named as their key
    "argcomplete": "python3-argcomplete",
    "catkin_pkg": "python3-catkin-pkg-modules",
    "h5py": "python3-h5py",
    "hypothesis": "python3-hypothesis",
    "jinja2": "python3-jinja2",
    "joblib": "python3-joblib",
    "lz4": "mcap-ros2-support",
    "markupsafe": "python3-jinja2",
    "matplotlib": "python3-matplotlib",
    "mcap": "mcap-ros2-support",
    "mcap_ros2": "mcap-ros2-support",
    "numpy": "python3-numpy",
    "pytest": "python3-pytest",
    "rich": "python3-rich",
    "rosbags": "python3-rosbags-pip",
    "scipy": "python3-scipy",
    "setuptools": "python3-pytest",  # whose package depends on what provides pkg_resources
    "sklearn": "python3-sklearn",
    "threadpoolctl": "python3-sklearn",
    "tf2_ros": "tf2_ros_py",
    "yaml": "python3-yaml",
    "zstandard": "mcap-ros2-support",
}
OPTIONAL = {
    "argcomplete",
    "gymnasium",
    "h5py",
    "joblib",
    "rich",
    "rosbags",
    "threadpoolctl",
}  # extras, or by pip only
ONLY_TO_BUILD = {"cython": "cython3"}  # compiled modules import it, and need it no longer when they are compiled
ONLY_BY_PIP = {"diptest", "gymnasium"}  # no key of rosdep
IMPORTS = re.compile(
    r"^ *(?:from (\w+)[\w.]* import |import (\w+)[\w.]*(?: as \w+)?$)"
    r"|(?:importorskip|import_module)\([\"'](\w+)[\w.]*[\"'][,)]",
    re.MULTILINE,
)
NO_DEPENDENCY = {"rosbag2_interfaces", "pieces_of_work"}  # used if it is installed; written by a test
OWN = {*FOLDERS, "msg_adapters", "benchmarks", "examples", "docs"}
HEADER = "# Copyright 2026 The push_predictor authors\n# SPDX-License-Identifier: Apache-2.0\n"
NO_CHECKOUT = {"build", "install", "log", "out", "dist"}


@cache
def package(name: str) -> Package:
    warnings: list[str] = []
    found = parse_package(str(FOLDERS[name] / "package.xml"), warnings=warnings)
    found.validate(warnings=warnings)
    assert warnings == []
    return found


@cache
def setup_arguments(name: str) -> dict[str, Any]:
    """What setup.py passes to setuptools."""
    import setuptools  # not at the top: every worker imports every test

    given: dict[str, Any] = {}
    before, setuptools.setup = setuptools.setup, given.update
    here = Path.cwd()
    try:
        os.chdir(FOLDERS[name])
        runpy.run_path("setup.py")
    finally:
        os.chdir(here)
        setuptools.setup = before
    return given


def keys_of(name: str, *kinds: str) -> set[str]:
    declared = package(name)
    return {str(dependency.name) for kind in kinds for dependency in getattr(declared, f"{kind}_depends")}


def sources(*rooms: str) -> Iterator[Path]:
    for room in rooms:
        for path in (REPOSITORY / room).rglob("*.py"):
            if not NO_CHECKOUT & set(path.relative_to(REPOSITORY).parts):
                yield path


def third_party(*rooms: str) -> set[str]:
    local = {path.stem for path in sources("test")} | OWN | NO_DEPENDENCY
    return {name for path in sources(*rooms) for name in imports_of(path)} - local - set(sys.stdlib_module_names)


@cache
def imports_of(path: Path) -> set[str]:
    return imports_in(path.read_text())


def imports_in(text: str) -> set[str]:
    """First names of imported modules, also of those that importorskip imports (ast takes ten times longer)."""
    return {name for names in IMPORTS.findall(text) for name in names if name}


# --- package.xml -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FOLDERS)
def test_package_xml_is_valid_and_names_its_schema_and_licence(name: str):
    assert (package(name).name, package(name).package_format) == (name, 3)
    assert "http://download.ros.org/schema/package_format3.xsd" in (FOLDERS[name] / "package.xml").read_text()
    (licence,) = package(name).licenses
    assert (str(licence), licence.file) == ("Apache-2.0", "LICENSE")
    assert (FOLDERS[name] / "LICENSE").read_text() == (REPOSITORY / "LICENSE").read_text()


@pytest.mark.parametrize("name", FOLDERS)
def test_all_packages_have_one_version(name: str):
    assert package(name).version == package("push_predictor").version
    if (FOLDERS[name] / "setup.py").exists():
        assert setup_arguments(name)["version"] == package(name).version
    else:
        assert f'\nversion = "{package(name).version}"\n' in (FOLDERS[name] / "pyproject.toml").read_text()
    assert f"\nversion: {package(name).version}\n" in (REPOSITORY / "CITATION.cff").read_text()
    assert push_predictor.__version__ == package(name).version
    assert f"## {package(name).version}" in (REPOSITORY / "CHANGELOG.md").read_text()


def test_what_the_library_imports_is_a_dependency():
    declared = keys_of("push_predictor", "exec")
    imported = third_party("push_predictor", "msg_adapters", "launch")
    assert {ONLY_TO_BUILD[name] for name in imported & ONLY_TO_BUILD.keys()} <= keys_of("push_predictor", "build")
    for name in imported - OPTIONAL - ONLY_TO_BUILD.keys():
        assert KEY_OF.get(name, name) in declared, name


def test_optional_imports_are_inside_functions_and_in_an_extra():
    extras = " ".join(text for texts in setup_arguments("push_predictor")["extras_require"].values() for text in texts)
    environment = set(sources("push_predictor/gym"))  # which nothing else imports, see test_architecture.py
    for path in set(sources("push_predictor", "msg_adapters")) - environment:
        if OPTIONAL & imports_of(path):
            top = [node for node in ast.parse(path.read_text()).body if not is_definition(node)]
            assert not OPTIONAL & imports_in(ast.unparse(ast.Module(top, []))), path
    paper = " ".join(setup_arguments("push_predictor_paper")["install_requires"])
    by_pip = f"{extras} {paper} {setup_arguments('push_predictor')['install_requires']}"
    assert all(name in by_pip for name in OPTIONAL)


def is_definition(node: ast.AST) -> bool:
    """Functions and classes, and what only a type checker reads."""
    return isinstance(node, (ast.FunctionDef, ast.ClassDef)) or "TYPE_CHECKING" in ast.unparse(node).split("\n")[0]


def test_what_the_tests_import_is_a_dependency():
    declared = keys_of("push_predictor", "exec", "test") | keys_of("push_predictor_interfaces", "exec")
    for name in third_party("test") - ONLY_BY_PIP:
        assert KEY_OF.get(name, name) in declared, name
    assert "python3-pytest-xdist" in declared  # the option -n of CONTRIBUTING.md


def test_what_the_papers_package_imports_is_a_dependency():
    for name in third_party("push_predictor_paper/push_predictor_paper") - ONLY_BY_PIP:
        assert KEY_OF.get(name, name) in keys_of("push_predictor_paper", "exec"), name


def test_rosdep_knows_every_key_and_no_rule_is_left_over():
    kinds = ("build", "buildtool", "exec", "test")
    declared = {key for name in FOLDERS for key in keys_of(name, *kinds)} - set(FOLDERS)
    assert declared == set(KEYS)
    for key, rule in KEYS.items():
        assert rule.keys() == {"debian", "ubuntu"}, key


# --- changelogs and headers ------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:nodes.Node.traverse")  # of catkin_pkg
@pytest.mark.parametrize("name", FOLDERS)
def test_the_changelog_has_the_version_and_can_be_released(name: str):
    text = (FOLDERS[name] / "CHANGELOG.rst").read_text()
    assert text.splitlines()[1] == f"Changelog for package {name}" and "\nForthcoming\n-----------\n" in text
    changelog = get_changelog_from_path(str(FOLDERS[name]), package_name=name)
    assert [version for version, _, _ in changelog.foreach_version()] == [package(name).version]


def test_every_source_file_begins_with_the_licence():
    rooms = [path.name for path in REPOSITORY.iterdir() if path.is_dir() and not path.name.startswith(".")]
    python = [*sources(*rooms), *REPOSITORY.glob("*.py")]
    others = [REPOSITORY / "scripts", FOLDERS["push_predictor_interfaces"]]
    scripts = [path for room in others for end in ("*.sh", "*.cmake", "CMakeLists.txt") for path in room.glob(end)]
    assert len(python) > 300 and len(scripts) > 5
    for path in [*python, *scripts, *(REPOSITORY / "scripts" / "run").iterdir(), REPOSITORY / ".ci" / "run"]:
        text = path.read_text()
        lines = text.splitlines(keepends=True)
        start = 1 if text.startswith("#!") else 0
        assert not text or "".join(lines[start : start + 2]) == HEADER, path


def test_the_doctor_checks_the_packages_and_modules_of_setup():
    given = setup_arguments("push_predictor")
    required = [row.split(">")[0].replace("PyYAML", "yaml") for row in given["install_requires"]]
    assert [*doctor_command.REQUIRED, *doctor_command.OPTIONAL] == required
    compiled = [extension.name for extension in given["ext_modules"]]
    assert [f"push_predictor.{name}" for name in doctor_command.COMPILED] == compiled


# --- colcon ----------------------------------------------------------------------------------------------------------


def test_colcon_is_given_the_folder_of_every_package():
    """It stops descending at the root, which is a package."""
    defaults = yaml.safe_load((REPOSITORY / "colcon_defaults.yaml").read_text())
    folders = [path.relative_to(REPOSITORY).as_posix() for path in FOLDERS.values()]
    assert defaults == {verb: {"base-paths": folders} for verb in ("build", "list", "test")}


def test_every_console_script_has_an_executable_for_ros2_run():
    """pip installs console scripts into bin/ only, and ros2 run looks into lib/push_predictor/."""
    given = setup_arguments("push_predictor")
    scripts = dict(line.split(" = ") for line in given["entry_points"]["console_scripts"])
    (installed,) = (files for folder, files in given["data_files"] if folder == "lib/push_predictor")
    assert sorted(installed) == sorted(f"scripts/run/{name}" for name in scripts)
    for name in scripts:
        path = REPOSITORY / "scripts" / "run" / name
        assert os.access(path, os.X_OK) and f'/../../bin/{name}"' in path.read_text()
        module = "push_predictor.cli" if name == "push_predictor" else f"push_predictor.nodes.{name}"
        assert f'exec python3 -m {module} "$@"' in path.read_text()


# --- jazzy example ----------------------------------------------------------------------------------------------------


SCRIPT = REPOSITORY / "scripts" / "jazzy_example.sh"
LINES = [line for line in SCRIPT.read_text().splitlines() if line and not line.startswith("#") and line != "set -e"]
CALLS = [shlex.split(line) for line in LINES]
TOOLS = {".", "[", "colcon", "export", "ros2", "rosdep", "sudo"}
OF_UBUNTU = {"python3-pip", "python3-rosdep", "python3-colcon-common-extensions"}  # the last two from ROS's repository


def words_after(*start: str) -> list[str]:
    """The words behind the only call that starts with these."""
    (found,) = (call[len(start) :] for call in CALLS if tuple(call[: len(start)]) == start)
    return found


def test_readme_names_the_script():
    assert f"`sh {SCRIPT.relative_to(REPOSITORY)}`" in (REPOSITORY / "README.md").read_text()


def test_the_shell_parses_it_and_every_tool_is_one_that_jazzy_has():
    subprocess.run(["sh", "-n", str(SCRIPT)], check=True)
    assert {call[0] for call in CALLS} == TOOLS
    assert set(words_after("sudo", "apt", "install", "-y")) == OF_UBUNTU
    assert words_after("export") == ["PIP_BREAK_SYSTEM_PACKAGES=1"]  # pip refuses Ubuntu's Python without it
    assert words_after("colcon", "build") == ["--packages-up-to", "push_predictor"]


def test_rosdep_is_given_the_folders_of_the_packages_that_are_built():
    """It stops descending at a package, and the root is one."""
    words = words_after("rosdep", "install")
    assert set(words[: words.index("--from-paths")]) == {"-y", "--ignore-src"}
    folders = words[words.index("--from-paths") + 1 :]
    assert folders == [".", "push_predictor_interfaces"]
    assert all((REPOSITORY / folder / "package.xml").is_file() for folder in folders)


def test_the_executable_and_its_command_exist():
    executable, *command = words_after("ros2", "run", "push_predictor")
    assert (REPOSITORY / "scripts" / "run" / executable).is_file()
    build_parser().parse_args(command)


def test_the_launch_file_takes_its_arguments(monkeypatch: pytest.MonkeyPatch):
    install_fake_launch(monkeypatch)
    name, *words = words_after("ros2", "launch", "push_predictor")
    launch_file: dict[str, Any] = load_launch_file(REPOSITORY / "launch" / name)
    given = dict(word.split(":=") for word in words)
    assert given.keys() <= {argument for argument, _, _ in launch_file["ARGUMENTS"]}
    recording = Path(given["recording"].replace("$PWD", str(REPOSITORY)))
    assert (recording / "metadata.yaml").is_file() and float(given["rate"]) > 0.0
    assert given["model"] == SHIPPED  # nothing is trained before


def test_every_documented_launch_names_a_file_and_its_arguments(monkeypatch: pytest.MonkeyPatch):
    install_fake_launch(monkeypatch)
    accepted = {
        path.name: {argument for argument, _, _ in load_launch_file(path)["ARGUMENTS"]}
        for path in (REPOSITORY / "launch").glob("*.launch.py")
    }
    documents = [SCRIPT, *REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").rglob("*.md")]
    text = "\n".join(path.read_text().replace("\\\n", " ") for path in documents)
    calls = re.findall(r"ros2 launch push_predictor (\w+\.launch\.py)([^`\n]*)", text)
    assert len(calls) > 8
    for name, words in calls:
        given = set(re.findall(r"(\w+):=", words)) - {"recrding"}  # the example of what is refused
        assert given <= accepted[name], words
