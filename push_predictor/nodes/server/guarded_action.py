# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An action whose goals run one at a time, in a thread of the executor; every failure gives its client a reason."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from functools import partial
from time import monotonic
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from msg_adapters.predictions import refuse
from push_predictor.error_codes import ErrorCode, error_code
from push_predictor.errors import BusyError, InactiveError, PushPredictorError

SENDING = 0.2  # s in which the executor sends a result after the end of its goal


class CancelledError(PushPredictorError):
    """The client cancelled the goal."""


class GuardedAction:
    """An action server of a node. doing: what it does for the present goal, in words, for the client of another one.

    work: called with a goal handle and a function that raises when nobody waits any more, to be called often; returns
    the result. may_begin, may_continue: raise InactiveError unless the node may accept a goal, continue with one.
    """

    def __init__(
        self,
        node: Node,
        kind: Any,
        name: str,
        work: Callable[[Any, Callable[[], None]], Any],
        may_begin: Callable[[], None],
        may_continue: Callable[[], None],
    ) -> None:
        self._log, self._kind, self._name = node.get_logger(), kind, name
        self._work, self._may_begin, self._may_continue = work, may_begin, may_continue
        self._running, self._ended = threading.Lock(), -SENDING
        self._counting, self._goals = threading.Lock(), 0  # accepted, without a result
        self.doing = ""
        ActionServer(
            node,
            kind,
            name,
            self._execute,
            callback_group=ReentrantCallbackGroup(),
            goal_callback=lambda request: GoalResponse.ACCEPT if self._accepts() else GoalResponse.REJECT,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
        )

    @property
    def settled(self) -> bool:
        """Whether no goal is accepted or runs, and the last result has been sent."""
        return not self._goals and monotonic() - self._ended > SENDING

    def _accepts(self) -> bool:
        """Whether a goal is accepted now; ROS gives a client no reason for a rejected goal, so the log has it."""
        self._count(1)  # before the check: a node that ends sees the goal, or the goal that the node ends
        try:
            self._may_begin()
        except InactiveError as error:
            self._count(-1)
            self._log.warning(f"{self._name}: goal rejected, {error}")
            return False
        return True

    def _count(self, change: int) -> None:
        with self._counting:
            self._goals += change

    def _execute(self, goal: Any) -> Any:
        try:
            return self._result(goal)
        finally:
            self._ended = monotonic()
            self._count(-1)

    def _result(self, goal: Any) -> Any:
        if not self._running.acquire(blocking=False):
            accepted = f"one at a time: {self.doing or self._name} is under way, wait or cancel it"
            return self._abort(goal, BusyError(f"goal: {self._name!r} is not accepted, give {accepted}"))
        try:
            result = self._work(goal, partial(self._check, goal))
            (goal.succeed if result.success else goal.abort)()
            return result
        except CancelledError as error:
            goal.canceled()
            return refuse(self._kind.Result(), str(error), ErrorCode.CANCELLED)
        except (PushPredictorError, OSError) as error:
            return self._abort(goal, error)
        except Exception as error:
            self._log.error(traceback.format_exc())
            return self._abort(goal, error)
        finally:
            self.doing = ""
            self._running.release()

    def _check(self, goal: Any) -> None:
        if goal.is_cancel_requested:
            raise CancelledError("cancelled: nothing was written or changed")
        self._may_continue()

    def _abort(self, goal: Any, error: Exception) -> Any:
        code, reason = error_code(error), " ".join(str(error).split())
        if code == ErrorCode.INTERNAL_ERROR:
            reason = f"internal error, see the log of the node: {error!r}"
        self._log.warning(f"{self._name}: {reason}")
        goal.abort()
        return refuse(self._kind.Result(), reason, code)
