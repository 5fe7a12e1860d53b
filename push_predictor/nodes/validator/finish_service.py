# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The service ~/finish: ends a validation run, and is answered once everything is written."""

from __future__ import annotations

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from push_predictor.nodes.rig_source import RigSource
from push_predictor.nodes.validator.model_source import ModelSource
from push_predictor.nodes.validator.result_writer import ResultWriter
from push_predictor.online.session import Session, State


class FinishService:
    """Offers ~/finish; callers wait while the executor does other work.

    Samples that come while a result is written, or its report is drawn, belong to the next run: it is not ended by the
    same call.
    """

    def __init__(
        self, node: Node, session: Session, models: ModelSource, rigs: RigSource, writer: ResultWriter
    ) -> None:
        self._arrived: list[Future] = []  # since the last turn
        self._callers: list[Future] = []  # of the run that is open, or comes next
        self._served: list[Future] = []  # of the run that has ended
        self._failure: str | None = None  # why its result could not be written; None until that is known
        self._unsent = 0
        self._session, self._models, self._rigs, self._writer = session, models, rigs, writer
        node.create_service(Trigger, "~/finish", self._on_call, callback_group=ReentrantCallbackGroup())

    @property
    def requested(self) -> bool:
        """Whether a caller waits for the end of a run."""
        return bool(self._callers)

    @property
    def sent(self) -> bool:
        """Whether the executor has sent all answers."""
        return not self._unsent

    async def _on_call(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._arrived.append(answer := Future())
        response = await answer  # its own turn of the executor, which sends it
        self._unsent -= 1
        return response

    def work(self) -> None:
        """Take the calls since the last time.

        Once a turn: a call that arrived between the end of a run and `answer` would be answered without a result.
        """
        self._callers += self._arrived
        self._arrived = []

    def ending(self) -> None:
        """Note that a run ends: its result is what all present callers wait for."""
        self._served, self._callers, self._failure = [*self._served, *self._callers], [], None

    def answer(self) -> None:
        """Answer the callers for whom nothing is left to be done; call it each turn, after the session's step."""
        draining, busy = self._session.state is State.DRAINING, self._writer.report.busy
        if self._served and self._failure is None and not draining:
            self._failure = self._session.failure
        if self._served and self._failure is not None and not busy:
            self._send(self._response(self._failure), self._served)
        if self._callers and not draining and not busy:
            self._send(self._response(self._session.failure), self._callers)

    def _send(self, response: Trigger.Response, callers: list[Future]) -> None:
        self._unsent += len(callers)
        while callers:
            callers.pop().set_result(response)

    def _response(self, failure: str) -> Trigger.Response:
        output = self._writer.folder
        if problem := failure or self._models.missing or self._rigs.missing:
            return Trigger.Response(success=False, message=problem)
        if self._writer.report.failed:
            text = f"The result is in {output}. The report failed: see the log of the node."
            return Trigger.Response(success=False, message=text)
        if self._session.state is State.WAITING:
            text = "No sample was received yet. Start the sensors or the replay."
            return Trigger.Response(success=False, message=text)
        text = str(output or "The parameter output is empty: nothing was written.")
        return Trigger.Response(success=True, message=text)
