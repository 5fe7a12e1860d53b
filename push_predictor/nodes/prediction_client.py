"""Asking predict_push as any planner would: a few requests in flight, each with a deadline, none forgotten."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic
from typing import Any

from push_predictor_interfaces.srv import PredictPush
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future

IN_FLIGHT = 8  # a service queue of the default depth holds ten
Answer = Callable[[PredictPush.Response], None]


@dataclass
class _Sent:
    future: Future
    deadline: float
    request: PredictPush.Request
    on_answer: Answer


class PredictionClient:
    """A queue of requests to predict_push. A request that meets its deadline unanswered is sent again."""

    def __init__(self, node: Node, timeout: float) -> None:
        self._client = node.create_client(PredictPush, "predict_push", qos_profile=QoSProfile(depth=100))
        self._timeout = timeout
        self._waiting: deque[tuple[PredictPush.Request, Answer]] = deque()
        self._sent: list[_Sent] = []
        self.timeouts = 0

    @property
    def open(self) -> int:
        """Requests without an answer yet."""
        return len(self._waiting) + len(self._sent)

    @property
    def server_is_there(self) -> bool:
        """Whether somebody offers the service."""
        return bool(self._client.service_is_ready())

    def ask(self, request: PredictPush.Request, on_answer: Answer) -> None:
        """Queue a request; on_answer gets the response, in the executor's thread."""
        self._waiting.append((request, on_answer))

    def work(self) -> None:
        """Send what may be sent, take back what was not answered in time. Call it often, from the executor's thread."""
        self._take_back(monotonic())
        while self._waiting and len(self._sent) < IN_FLIGHT and self.server_is_there:
            self._send(*self._waiting.popleft())

    def forget(self) -> int:
        """Give up all open requests; returns how many."""
        lost = self.open
        for sent in self._sent:
            self._client.remove_pending_request(sent.future)
        self._sent.clear()
        self._waiting.clear()
        return lost

    def _send(self, request: PredictPush.Request, on_answer: Answer) -> None:
        sent = _Sent(self._client.call_async(request), monotonic() + self._timeout, request, on_answer)
        self._sent.append(sent)
        sent.future.add_done_callback(lambda future: self._answered(sent, future))

    def _answered(self, sent: _Sent, future: Any) -> None:
        if sent not in self._sent:  # given up, or taken back just before
            return
        self._sent.remove(sent)
        if (response := future.result()) is not None:
            sent.on_answer(response)
        self.work()

    def _take_back(self, now: float) -> None:
        for sent in [sent for sent in self._sent if sent.deadline < now]:
            self.timeouts += 1
            self._sent.remove(sent)
            self._client.remove_pending_request(sent.future)
            self._waiting.appendleft((sent.request, sent.on_answer))
