"""The service ~/finish on a made-up middleware: when callers are answered, and with what."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from std_srvs.srv import Trigger

from push_predictor.nodes.validator.finish_service import FinishService
from push_predictor.online.session import Session


class Service:
    """Holds the calls until the node takes them, and the responses."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.responses: list[tuple[str, Trigger.Response]] = []
        self.handle: Any = nullcontext()
        self.handle.service_take_request = lambda kind: (kind(), self.calls.pop(0) if self.calls else None)

    def send_response(self, response: Trigger.Response, caller: str) -> None:
        self.responses.append((caller, response))


def finish_service(service: Service, session: Session, missing: str = "") -> FinishService:
    node: Any = SimpleNamespace(create_service=lambda *_, **__: service)
    models: Any = SimpleNamespace(missing=missing)
    rigs: Any = SimpleNamespace(missing="")
    writer: Any = SimpleNamespace(folder=Path("result"), report=SimpleNamespace(busy=False, failed=False))
    return FinishService(node, session, models, rigs, writer)


def test_a_call_that_arrives_within_a_turn_waits_for_the_end_of_its_run() -> None:
    service, session = Service(), Session(last_answers=30.0, report=False)
    finish = finish_service(service, session)
    session.open(0.0)
    finish.work()
    assert not session.drain_if_due(0.0, finish.requested, rig_changed=False)
    service.calls.append("caller")
    finish.answer()
    assert not service.responses
    finish.work()
    assert session.drain_if_due(0.1, finish.requested, rig_changed=False)
    finish.answer()
    assert not service.responses, "the run is draining"
    session.written()
    finish.answer()
    ((caller, response),) = service.responses
    assert (caller, response.success, response.message) == ("caller", True, "result")
    assert not finish.requested


def test_all_callers_get_the_reason_why_no_run_can_begin() -> None:
    service = Service()
    finish = finish_service(service, Session(last_answers=30.0, report=False), missing="no model")
    service.calls += ["first", "second"]
    finish.work()
    finish.answer()
    assert {caller for caller, _ in service.responses} == {"first", "second"}
    assert {(response.success, response.message) for _, response in service.responses} == {(False, "no model")}


def test_without_samples_there_is_nothing_to_write() -> None:
    service = Service()
    finish = finish_service(service, Session(last_answers=30.0, report=False))
    service.calls.append("caller")
    finish.work()
    finish.answer()
    assert not service.responses[0][1].success and "No sample" in service.responses[0][1].message
