# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The entry of the nodes: signals are handled before the imports, whichever way a node is started."""

from __future__ import annotations

import ast
import signal
from types import SimpleNamespace

import pytest
from repository import REPOSITORY

from push_predictor.blas_threads import VARIABLES
from push_predictor.nodes import entry

NODES = ("predict_server", "push_recorder", "push_replay", "push_validator")


@pytest.mark.parametrize("node", NODES)
def test_signals_are_handled_before_a_node_is_imported(node: str, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[object] = []

    def import_module(name: str) -> SimpleNamespace:
        done.append(name)
        return SimpleNamespace(main=lambda: 7)

    for name in VARIABLES:
        monkeypatch.setenv(name, "1")
    monkeypatch.setattr(signal, "signal", lambda number, handler: done.append((number, handler)))
    monkeypatch.setattr(entry, "import_module", import_module)
    assert getattr(entry, node)() == 7
    handlers = [(signal.SIGINT, entry._end), (signal.SIGTERM, entry._end)]
    assert done == [*handlers, f"push_predictor.nodes.{node}"]


@pytest.mark.parametrize("node", NODES)
def test_python_m_begins_with_the_entry(node: str) -> None:
    body = ast.parse((REPOSITORY / "push_predictor" / "nodes" / f"{node}.py").read_text()).body
    begin = [ast.unparse(statement).splitlines()[0] for statement in body[1:4]]
    assert begin == ["from __future__ import annotations", "import sys", "if __name__ == '__main__':"]
    assert f"entry.{node}()" in ast.unparse(body[3])
    assert '"{node} = push_predictor.nodes.entry:{node}"' in (REPOSITORY / "setup.py").read_text()
