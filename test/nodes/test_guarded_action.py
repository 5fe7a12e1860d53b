# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Actions on a made-up middleware: when an ending node need not wait for them any more."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.action import GoalResponse

from push_predictor.errors import InactiveError
from push_predictor.nodes.server import actions
from push_predictor.nodes.server.actions import GuardedAction
from push_predictor_interfaces.action import SuggestPushes


class Middleware:
    """An action server of which the test calls the callbacks, and its log."""

    def __init__(self) -> None:
        self.warnings: list[str] = []
        self.callbacks: dict[str, Any] = {}

    def create(self, node: Any, kind: Any, name: str, execute: Any, **callbacks: Any) -> None:
        self.callbacks = {"execute": execute, **callbacks}

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=self.warnings.append)

    def request(self) -> GoalResponse:
        response: GoalResponse = self.callbacks["goal_callback"](SuggestPushes.Goal())
        return response

    def execute(self) -> Any:
        goal = SimpleNamespace(is_cancel_requested=False, succeed=lambda: None, abort=lambda: None)
        return self.callbacks["execute"](goal)


def action_of(middleware: Any, monkeypatch: pytest.MonkeyPatch, may_begin: Any = lambda: None) -> GuardedAction:
    monkeypatch.setattr(actions, "ActionServer", middleware.create)
    monkeypatch.setattr(actions, "SENDING", 0.0)
    result = SuggestPushes.Result(success=True)
    return GuardedAction(middleware, SuggestPushes, "suggest", lambda *_: result, may_begin, lambda: None)


def test_an_accepted_goal_is_waited_for_before_it_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    action = action_of(middleware := Middleware(), monkeypatch)
    assert action.settled
    assert middleware.request() == middleware.request() == GoalResponse.ACCEPT
    assert not action.settled, "neither has begun"
    assert middleware.execute().success
    assert not action.settled, "one has not begun"
    assert middleware.execute().success
    assert action.settled


def test_a_rejected_goal_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def may_begin() -> None:
        assert not action.settled, "a node that ends sees the goal, or the goal that the node ends"
        raise InactiveError("the node ends")

    action = action_of(middleware := Middleware(), monkeypatch, may_begin)
    assert middleware.request() == GoalResponse.REJECT
    assert action.settled and middleware.warnings == ["suggest: goal rejected, the node ends"]
