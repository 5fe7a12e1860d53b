# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a validator asks of predict_server: the files of its models (list_models), and predictions (predict_push)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any, TypeAlias

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future

from push_predictor.error_codes import ErrorCode
from push_predictor.errors import ModelFileError, RequestError
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor_interfaces.srv import ListModels, PredictPush

PATIENCE = 5.0  # s after which an unanswered request of list_models is sent again
IN_FLIGHT = 8  # a service queue of the default depth has ten places
DEPTH = 1000  # a client receives the answers to all clients, which would crowd its own out of a short queue
QUIET = 10.0  # s without an overdue request after which a server counts as answering again
PAUSE = 1.0  # s after which a request is repeated that the server could not answer, or not for all models
NOT_NOW = (ErrorCode.NOT_ACTIVE, ErrorCode.UNKNOWN_MODEL)  # refusals because of the server's state, not of the push
Answer: TypeAlias = Callable[[PredictPush.Response], None]


class ModelSource:
    """Loads models: files at once, names once the server reports where their files are.

    wanted: paths or names, the main model first; an empty text is the server's default model. Raises ModelFileError for
    a file that is no model, RequestError for two files whose models have the same name.
    """

    def __init__(self, node: Node, wanted: Sequence[str]) -> None:
        self._wanted = list(dict.fromkeys(wanted))
        self._files = {text: Path(text).expanduser().resolve() for text in self._wanted if _is_path(text)}
        loaded = {text: load_model(path) for text, path in self._files.items()}
        self._found = {text: (model.name, model) for text, model in loaded.items()}
        self._client = node.create_client(ListModels, "list_models")
        self._request: Future | None = None
        self._next = 0.0
        self.problems: list[str] = []
        names = [model.name for model in loaded.values()]
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise RequestError("compare", repeated, "model files whose models have different names")

    def models(self) -> dict[str, PushModel] | None:
        """All wanted models by the name to request, or None while some are unknown."""
        if len(self._found) < len(self._wanted):
            return None
        return dict(self._found[text] for text in self._wanted)

    @property
    def missing(self) -> str:
        """In words, which models are not known, empty if all are."""
        if self.models() is not None:
            return ""
        return " ".join(self.problems) or "Waiting for list_models of predict_server."

    def work(self) -> None:
        """Request the server's list until it settles everything. Call it often, in the executor's thread."""
        now = monotonic()
        if self._request is not None and self._request.done():
            self._take(self._request.result())
            self._request, self._next = None, now + PAUSE if self.problems else inf
        if now < self._next or not self._client.service_is_ready():
            return
        if self._request is not None:  # the server went away in between
            self._client.remove_pending_request(self._request)
        self._request, self._next = self._client.call_async(ListModels.Request()), now + PATIENCE

    def _take(self, response: ListModels.Response) -> None:
        files = {info.name: info.file for info in response.models}
        self.problems = [
            problem for text in self._wanted if (problem := self._settle(text, files, response.default_model))
        ]

    def _settle(self, text: str, files: Mapping[str, str], default: str) -> str:
        """In words, what is wrong with a wanted model, empty if nothing."""
        if text in self._files:
            return self._difference(self._found[text][0], self._files[text], files)
        name = text or default
        if text in self._found:
            return ""
        if not files.get(name):
            known = ", ".join(files) or "none"
            return f"predict_server has no model {name!r}. Its models: {known}. Call load_model, or set model."
        try:
            self._found[text] = (name, load_model(Path(files[name])))
        except ModelFileError as error:
            return f"Model {name!r} of predict_server cannot be loaded: {error}"
        return ""

    def _difference(self, name: str, path: Path, files: Mapping[str, str]) -> str:
        if name not in files:
            return f"predict_server has not loaded model {name!r} of {path}. Call load_model."
        if files[name] and Path(files[name]) != path:
            return f"predict_server loaded model {name!r} from {files[name]}, not from {path}."
        return ""


@dataclass(eq=False)
class _Pending:
    """A request and its on_answer; futures: one for each time that it was sent."""

    request: PredictPush.Request
    on_answer: Answer
    deadline: float = 0.0
    futures: list[Future] = field(default_factory=list)


class PredictionClient:
    """Queues of requests to predict_push, one for each model.

    A request without an answer at its deadline is sent again; the first answer counts. One that is refused because of
    the server's state (a model not loaded yet, a node not active) waits and is sent again.
    """

    def __init__(self, node: Node, timeout: float) -> None:
        self._client = node.create_client(PredictPush, "predict_push", qos_profile=QoSProfile(depth=DEPTH))
        self._timeout = timeout
        self._waiting: dict[str, deque[_Pending]] = {}
        self._blocked: dict[str, tuple[float, str]] = {}  # by model: until when, and why
        self._sent: list[_Pending] = []
        self._overdue = -QUIET  # when a request was last overdue
        self.timeouts = 0

    @property
    def open(self) -> int:
        """Requests without an answer yet."""
        return len(self._sent) + sum(map(len, self._waiting.values()))

    @property
    def server_available(self) -> bool:
        """Whether a node offers the service."""
        return bool(self._client.service_is_ready())

    @property
    def problems(self) -> list[str]:
        """In words, that the server does not answer, and why it refuses some models."""
        silent = (
            [f"no answer within {self._timeout:g} s, requests are sent again"]
            if monotonic() - self._overdue < QUIET
            else []
        )
        return [f"predict_push: {reason}" for reason in [*silent, *(reason for _, reason in self._blocked.values())]]

    def ask(self, request: PredictPush.Request, on_answer: Answer) -> None:
        """Queue a request; on_answer gets the response, in the executor's thread."""
        self._waiting.setdefault(request.model, deque()).append(_Pending(request, on_answer))

    def work(self) -> None:
        """Send waiting and overdue requests. Call it often, in the executor's thread."""
        if not self.open or not self.server_available:
            return
        now = monotonic()
        for pending in self._sent:
            if pending.deadline < now:
                self._overdue = now
                self.timeouts += 1
                self._send(pending, now)
        while len(self._sent) < IN_FLIGHT and (queue := self._next_queue(now)) is not None:
            self._sent.append(pending := queue.popleft())
            self._send(pending, now)

    def forget(self) -> None:
        """Give up all open requests."""
        for pending in self._sent:
            self._abandon(pending)
        self._sent.clear()
        self._waiting.clear()
        self._blocked.clear()
        self._overdue = -QUIET

    def _next_queue(self, now: float) -> deque[_Pending] | None:
        """The longest queue of the models whose requests may be sent now."""
        free = [q for model, q in self._waiting.items() if q and self._blocked.get(model, (0.0, ""))[0] <= now]
        return max(free, key=len, default=None)

    def _send(self, pending: _Pending, now: float) -> None:
        pending.deadline = now + self._timeout
        future = self._client.call_async(pending.request)
        pending.futures.append(future)
        future.add_done_callback(lambda done: self._answered(pending, done))

    def _answered(self, pending: _Pending, future: Any) -> None:
        if pending not in self._sent:  # answered before, or given up
            return
        self._sent.remove(pending)
        self._abandon(pending)
        response, model = future.result(), pending.request.model
        if not response.success and response.error_code in NOT_NOW:
            self._blocked[model] = (monotonic() + PAUSE, response.message)
            self._waiting[model].appendleft(_Pending(pending.request, pending.on_answer))
        else:
            self._blocked.pop(model, None)
            pending.on_answer(response)
        self.work()

    def _abandon(self, pending: _Pending) -> None:
        for future in pending.futures:
            self._client.remove_pending_request(future)


def _is_path(text: str) -> bool:
    return "/" in text or Path(text).is_file()
