"""Asking predict_push as any planner would: a few requests in flight, each with a deadline, none forgotten."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from time import monotonic
from typing import Any, TypeAlias

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future

from push_predictor_interfaces.srv import PredictPush

IN_FLIGHT = 8  # a service queue of the default depth holds ten
DEPTH = 1000  # the middleware hands a client the answers to all clients: in a short queue they crowd out its own
PAUSE = 1.0  # s before a server that cannot answer for a model is asked about it again
SELDOM = 10.0  # s between two lines in the log about a server too busy to answer in time
NOT_NOW = ("model:", "default_model:", "the node is ")  # refusals that speak of the server, not of the push
Answer: TypeAlias = Callable[[PredictPush.Response], None]


@dataclass(eq=False)
class _Asked:
    """A request and its on_answer; futures: one for each time that it was sent."""

    request: PredictPush.Request
    on_answer: Answer
    deadline: float = 0.0
    futures: list[Future] = field(default_factory=list)


@dataclass
class _Silence:
    """Of the server: since when (monotonic), and how often requests were sent again."""

    since: float
    sent_again: int = 0


class PredictionClient:
    """A queue of requests to predict_push, one a model.

    A request that meets its deadline unanswered is sent again; the first answer counts. One that is refused because of
    the server's state (a model not loaded yet, a node not active) waits and is sent again. A server that falls silent
    is told in the log, and so is what had to be sent again once it answers.
    """

    def __init__(self, node: Node, timeout: float) -> None:
        self._client = node.create_client(PredictPush, "predict_push", qos_profile=QoSProfile(depth=DEPTH))
        self._wait_set = rclpy_implementation.WaitSet(0, 0, 0, 1, 0, 0, node.context.handle)
        self._taking = False
        self._timeout, self._log = timeout, node.get_logger()
        self._waiting: dict[str, deque[_Asked]] = {}
        self._blocked: dict[str, tuple[float, str]] = {}  # by model: until when, and why
        self._sent: list[_Asked] = []
        self._silence: _Silence | None = None
        self.timeouts = 0

    @property
    def open(self) -> int:
        """Requests without an answer yet."""
        return len(self._sent) + sum(map(len, self._waiting.values()))

    @property
    def server_is_there(self) -> bool:
        """Whether somebody offers the service."""
        return bool(self._client.service_is_ready())

    @property
    def problems(self) -> list[str]:
        """Why the server does not answer for some models, in its words; that it does not answer at all."""
        silent = [f"no answer within {self._timeout:g} s, asking again"] if self._silence else []
        return [f"predict_push: {reason}" for reason in [*silent, *(reason for _, reason in self._blocked.values())]]

    def ask(self, request: PredictPush.Request, on_answer: Answer) -> None:
        """Queue a request; on_answer gets the response, in the executor's thread."""
        self._waiting.setdefault(request.model, deque()).append(_Asked(request, on_answer))

    def work(self) -> None:
        """Send what may be sent, again what was not answered in time. Call it often, from the executor's thread."""
        self._take_answers()
        if not self.open or not self.server_is_there:
            return
        now = monotonic()
        for asked in self._sent:
            if asked.deadline < now:
                self._note_silence(now)
                self._send(asked, now)
        while len(self._sent) < IN_FLIGHT and (queue := self._next_queue(now)) is not None:
            self._sent.append(asked := queue.popleft())
            self._send(asked, now)

    def forget(self) -> None:
        """Give up all open requests."""
        for asked in self._sent:
            self._abandon(asked)
        self._sent.clear()
        self._waiting.clear()
        self._blocked.clear()
        self._silence = None

    def _take_answers(self) -> None:
        """All that have arrived: an executor that is busy with samples hands over one a turn, and that late."""
        if self._taking:
            return
        self._taking = True
        try:
            while self._one_waits():
                header, response = self._client.handle.take_response(PredictPush.Response)
                if header is None:  # it was for another client
                    continue
                with suppress(KeyError):  # it was sent again, and answered before
                    self._client.get_pending_request(header.request_id.sequence_number).set_result(response)
        finally:
            self._taking = False

    def _one_waits(self) -> bool:
        self._wait_set.clear_entities()
        self._wait_set.add_client(self._client.handle)
        self._wait_set.wait(0)
        return bool(self._wait_set.get_ready_entities("client"))

    def _note_silence(self, now: float) -> None:
        self.timeouts += 1
        if self._silence is None:
            self._silence = _Silence(now - self._timeout)
            text = f"predict_push: no answer within {self._timeout:g} s, asking until there is one"
            self._log.warning(text, throttle_duration_sec=SELDOM)
        self._silence.sent_again += 1

    def _note_answer(self) -> None:
        if (silence := self._silence) is not None:
            self._silence = None
            self._log.warning(
                f"predict_push answers again after {monotonic() - silence.since:.1f} s: requests were sent again "
                f"{silence.sent_again} times, {self.open} wait, none was given up",
                throttle_duration_sec=SELDOM,
            )

    def _next_queue(self, now: float) -> deque[_Asked] | None:
        """Of the models that may be asked about, the one with the most to ask."""
        free = [q for model, q in self._waiting.items() if q and self._blocked.get(model, (0.0, ""))[0] <= now]
        return max(free, key=len, default=None)

    def _send(self, asked: _Asked, now: float) -> None:
        asked.deadline = now + self._timeout
        future = self._client.call_async(asked.request)
        asked.futures.append(future)
        future.add_done_callback(lambda done: self._answered(asked, done))

    def _answered(self, asked: _Asked, future: Any) -> None:
        if asked not in self._sent:  # answered before, or given up
            return
        self._sent.remove(asked)
        self._abandon(asked)
        self._note_answer()
        response, model = future.result(), asked.request.model
        if not response.success and response.message.startswith(NOT_NOW):
            self._blocked[model] = (monotonic() + PAUSE, response.message)
            self._waiting[model].appendleft(_Asked(asked.request, asked.on_answer))
        else:
            self._blocked.pop(model, None)
            asked.on_answer(response)
        self.work()

    def _abandon(self, asked: _Asked) -> None:
        for future in asked.futures:
            self._client.remove_pending_request(future)
