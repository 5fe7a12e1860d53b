# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Mutants: places of the sources where a sign, factor, number, bound, junction, extreme or check is changed."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
SOURCES = ("push_predictor", "push_predictor_paper/push_predictor_paper", "msg_adapters")

_OPERATORS = {
    ast.Add: ("sign", "+", "-"),
    ast.Sub: ("sign", "-", "+"),
    ast.Mult: ("factor", "*", "/"),
    ast.Div: ("factor", "/", "*"),
}
_BOUNDS = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
}
_EXTREMES = {
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "argmin": "argmax",
    "argmax": "argmin",
    "any": "all",
    "all": "any",
}

_LEAVES = (ast.Raise, ast.Return, ast.Continue)  # what ends a check


@dataclass(frozen=True)
class Mutant:
    """One changed place: the file (relative to the root), the function around it, and a line's text before and after.

    `nth` tells lines of equal text in one file apart, so that the mutant is found again where the lines have moved.
    """

    file: str
    function: str
    kind: str
    before: str
    after: str
    nth: int

    def applied(self, text: str) -> str | None:
        """The file's text with the mutant in it; None where the line no longer exists."""
        lines = text.split("\n")
        places = [i for i, line in enumerate(lines) if line == self.before]
        if self.nth >= len(places):
            return None
        lines[places[self.nth]] = self.after
        return "\n".join(lines)


def drawn(count: int, seed: int, within: str = "") -> list[Mutant]:
    """At most `count` mutants of the files whose path begins with `within`.

    Long files have more of them. All kinds of a file are equally likely: constants would outnumber checks.
    """
    rng = np.random.default_rng(seed)
    by_file = {path: kinds for path in sources(within) if (kinds := _by_kind(path))}
    sizes = np.array([sum(map(len, kinds.values())) for kinds in by_file.values()], dtype=float)
    chosen: dict[Mutant, None] = {}
    while len(chosen) < min(count, sum(sizes)):
        kinds = list(by_file.values())[rng.choice(len(sizes), p=sizes / sizes.sum())]
        of_kind = kinds[sorted(kinds)[rng.integers(len(kinds))]]
        chosen[of_kind[rng.integers(len(of_kind))]] = None
    return list(chosen)


def sources(within: str = "") -> list[Path]:
    """The Python files that are not compiled: the changed text of a compiled one would not run."""
    files = [path for folder in SOURCES for path in sorted((ROOT / folder).rglob("*.py")) if "build" not in path.parts]
    chosen = [path for path in files if str(path.relative_to(ROOT)).startswith(within)]
    return [path for path in chosen if "import cython" not in path.read_text()]


def _by_kind(path: Path) -> dict[str, list[Mutant]]:
    text = path.read_text()
    lines = text.split("\n")
    kinds: dict[str, list[Mutant]] = {}
    for function, node in _nodes(ast.parse(text), ""):
        for kind, line, start, end, new in _changes(node, lines):
            before = lines[line]
            if not before.isascii():  # columns are bytes
                continue
            after = before[:start] + new + before[end:]
            nth = lines[:line].count(before)
            kinds.setdefault(kind, []).append(Mutant(str(path.relative_to(ROOT)), function, kind, before, after, nth))
    return kinds


def _nodes(node: ast.AST, function: str) -> Iterator[tuple[str, ast.AST]]:
    """All nodes with the qualified name of their function; not annotations, messages of errors and formatted text."""
    if isinstance(node, (ast.Raise, ast.JoinedStr)):
        return
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_params"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                inside = function
                if isinstance(child, (ast.FunctionDef, ast.ClassDef)):
                    inside = f"{function}.{child.name}".lstrip(".")
                yield inside, child
                yield from _nodes(child, inside)


def _changes(node: ast.AST, lines: list[str]) -> Iterator[tuple[str, int, int, int, str]]:
    """Kind, line, first and last column and new text of each change of one node; only within one line."""
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS and not _is_text(node):
        kind, old, new = _OPERATORS[type(node.op)]
        yield from _between(kind, node.left, node.right, old, new, lines)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.Not)) and node.lineno == node.end_lineno:
        yield _at(node, "sign" if isinstance(node.op, ast.USub) else "junction", _text(node.operand, lines))
    elif isinstance(node, ast.Compare) and type(node.ops[0]) in _BOUNDS:
        yield from _between("bound", node.left, node.comparators[0], *_BOUNDS[type(node.ops[0])], lines)
    elif isinstance(node, ast.BoolOp):
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        yield from _between("junction", node.values[0], node.values[1], old, new, lines)
    elif isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        yield _at(node, "number", repr(_other(node.value)))
    elif isinstance(node, ast.Call):
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in _EXTREMES and node.func.end_lineno == node.func.lineno:
            end = node.func.end_col_offset or 0
            yield "extreme", node.func.lineno - 1, end - len(name), end, _EXTREMES[name]
    elif isinstance(node, ast.If) and isinstance(node.body[-1], _LEAVES) and node.test.lineno == node.test.end_lineno:
        yield _at(node.test, "check", "False")


def _between(
    kind: str, left: ast.expr, right: ast.expr, old: str, new: str, lines: list[str]
) -> Iterator[tuple[str, int, int, int, str]]:
    if left.end_lineno != right.lineno:
        return
    start, line = left.end_col_offset or 0, right.lineno - 1
    place = lines[line].find(old, start, right.col_offset)
    if place >= 0:
        yield kind, line, place, place + len(old), new


def _at(node: ast.expr, kind: str, new: str) -> tuple[str, int, int, int, str]:
    return kind, node.lineno - 1, node.col_offset, node.end_col_offset or 0, new


def _text(node: ast.expr, lines: list[str]) -> str:
    return lines[node.lineno - 1][node.col_offset : node.end_col_offset]


def _other(value: float) -> float:
    return value + 1 if isinstance(value, int) else 2.0 * value or 1.0


def _is_text(node: ast.BinOp) -> bool:
    return any(
        isinstance(side, ast.JoinedStr) or isinstance(getattr(side, "value", None), str)
        for side in (node.left, node.right)
    )
