# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The service ~/finish: ends a validation run, and is answered once everything is written."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node
from std_srvs.srv import Trigger

from push_predictor.nodes.polling import NoExecutor, not_called, take_request
from push_predictor.nodes.rig_source import RigSource
from push_predictor.nodes.validator.results import ResultWriter
from push_predictor.nodes.validator.server_client import ModelSource
from push_predictor.online.session import Session, State


class FinishService:
    """Offers ~/finish; the node takes its calls itself, and answers them when there is something to state.

    Samples that come while a result is written, or its report is drawn, belong to the next run: it is not ended by the
    same call.
    """

    def __init__(
        self, node: Node, session: Session, models: ModelSource, rigs: RigSource, writer: ResultWriter
    ) -> None:
        self._callers: list[Any] = []  # of the run that is open, or comes next
        self._served: list[Any] = []  # of the run that has ended
        self._failure: str | None = None  # why its result could not be written; None until that is known
        self._session, self._models, self._rigs, self._writer = session, models, rigs, writer
        self._service = node.create_service(Trigger, "~/finish", not_called, callback_group=NoExecutor())

    @property
    def requested(self) -> bool:
        """Whether a caller waits for the end of a run."""
        return bool(self._callers)

    def work(self) -> None:
        """Take the calls since the last time."""
        while (caller := take_request(self._service)[1]) is not None:
            self._callers.append(caller)

    def ending(self) -> None:
        """Note that a run ends: its result is what all present callers wait for."""
        self._served, self._callers, self._failure = [*self._served, *self._callers], [], None

    def answer(self) -> None:
        """Answer the callers for whom nothing is left to be done; call it each turn, after the session's step."""
        draining, busy = self._session.state is State.DRAINING, self._writer.report.alive
        if self._served and self._failure is None and not draining:
            self._failure = self._session.failure
        if self._served and self._failure is not None and not busy:
            self._send(self._response(self._failure), self._served)
        if self._callers and not draining and not busy:
            self._send(self._response(self._session.failure), self._callers)

    def _send(self, response: Trigger.Response, callers: list[Any]) -> None:
        while callers:
            self._service.send_response(response, callers.pop())

    def _response(self, failure: str) -> Trigger.Response:
        output = self._writer.folder
        if problem := failure or self._models.missing or self._rigs.missing:
            return Trigger.Response(success=False, message=problem)
        if self._writer.report.status():
            text = f"The result is in {output}. The report failed: see the log of the node."
            return Trigger.Response(success=False, message=text)
        if self._session.state is State.WAITING:
            text = "No sample was received yet. Start the sensors or the replay."
            return Trigger.Response(success=False, message=text)
        text = str(output or "The parameter output is empty: nothing was written.")
        return Trigger.Response(success=True, message=text)
