# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Imports between the folders of models/ point one way."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from repository import REPOSITORY

MODELS = REPOSITORY / "push_predictor" / "models"
# A folder may import from those before it, and from the modules of models/ itself.
ORDER = ["gaussian_process", "mechanics", "effects", "predictors", "tabulated", "store"]


def folders_imported_by(path: Path) -> set[str]:
    modules = [n.module or "" for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.ImportFrom)]
    inside = [module.split(".")[2] for module in modules if module.startswith("push_predictor.models.")]
    return {name for name in inside if (MODELS / name).is_dir()}


def test_order_names_every_folder() -> None:
    assert sorted(ORDER) == sorted(path.parent.name for path in MODELS.glob("*/__init__.py"))


@pytest.mark.parametrize("folder", ORDER)
def test_folder_imports_only_from_earlier_ones(folder: str) -> None:
    allowed = set(ORDER[: ORDER.index(folder) + 1])
    for path in sorted((MODELS / folder).rglob("*.py")):
        assert folders_imported_by(path) <= allowed, path


def test_mechanics_imports_no_regression() -> None:
    for path in sorted((MODELS / "mechanics").rglob("*.py")):
        assert folders_imported_by(path) <= {"mechanics"}, path
