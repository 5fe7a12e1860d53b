# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Folders of `recordings` import in one direction: files and windows know nothing of the modules built on them."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest
from repository import REPOSITORY

ROOT = "push_predictor.recordings"
SOURCES = {
    ".".join(path.relative_to(REPOSITORY).with_suffix("").parts).removesuffix(".__init__"): path
    for path in (REPOSITORY / "push_predictor" / "recordings").rglob("*.py")
}


@cache
def imported(path: Path) -> set[str]:
    """The modules of `recordings` that a module imports itself."""
    nodes = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
    names = {f"{node.module}.{alias.name}" for node in nodes for alias in node.names}
    return ({node.module for node in nodes if node.module} | names) & SOURCES.keys()


def reached(name: str) -> set[str]:
    """The modules of `recordings` that a module imports directly or indirectly."""
    found: set[str] = set()
    waiting = [name]
    while waiting:
        new = imported(SOURCES[waiting.pop()]) - found
        found |= new
        waiting += new
    return found


def test_no_module_imports_itself() -> None:
    assert [name for name in SOURCES if name in reached(name)] == []


@pytest.mark.parametrize("folder", ["bag", "windows"])
def test_files_and_windows_import_neither_each_other_nor_what_uses_them(folder: str) -> None:
    inside = {name for name in SOURCES if name.startswith(f"{ROOT}.{folder}.")}
    for name in inside:
        for other in reached(name) - inside:
            assert not (imported(SOURCES[other]) & inside), f"{name} -> {other} -> {folder}"
            assert not other.startswith((f"{ROOT}.bag", f"{ROOT}.windows", f"{ROOT}.importers")), f"{name} -> {other}"


def test_only_the_command_line_and_tests_import_the_importers() -> None:
    importers = f"{ROOT}.importers"
    users = [name for name in SOURCES if any(other.startswith(importers) for other in imported(SOURCES[name]))]
    assert all(name.startswith(importers) for name in users)
