"""The service ~/finish: ends a validation run, and is answered once everything is written."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node

from push_predictor.nodes.polling import DeferredTrigger
from push_predictor.nodes.validator.result_writer import ResultWriter
from push_predictor.online.session import Session, State


class FinishService:
    """Offers ~/finish. hindrance: returns in words why no run can begin, empty if one can."""

    def __init__(self, node: Node, session: Session, writer: ResultWriter, hindrance: Callable[[], str]) -> None:
        self._service = DeferredTrigger(node, "~/finish")
        self._session, self._writer, self._hindrance = session, writer, hindrance

    def requested(self) -> bool:
        """Whether a caller waits for the answer."""
        return self._service.asked()

    def answer(self) -> None:
        """Answer all callers if nothing is left to be done."""
        if self._session.state is State.DRAINING or self._writer.report.busy or not self.requested():
            return
        output = self._writer.folder
        if problem := self._session.failure or self._hindrance():
            self._service.answer(False, problem)
        elif self._writer.report.failed:
            self._service.answer(False, f"The result is in {output}. The report failed: see the log of the node.")
        elif self._session.state is State.WAITING:
            self._service.answer(False, "No sample was received yet.")
        else:
            self._service.answer(True, str(output or "The parameter output is empty: nothing was written."))
