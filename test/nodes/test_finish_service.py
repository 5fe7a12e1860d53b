# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The service ~/finish on a made-up middleware: when callers are answered, and with what."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from std_srvs.srv import Trigger

from push_predictor.nodes.push_validator import PushValidator
from push_predictor.nodes.validator.finish_service import FinishService
from push_predictor.online.session import Session


class Service:
    """Holds calls until the node takes them, and the responses."""

    srv_type = Trigger

    def __init__(self) -> None:
        self.responses: list[tuple[str, Trigger.Response]] = []
        self._waiting: list[str] = []
        self.handle = self

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...

    def create(self, kind: type, name: str, callback: object, callback_group: object) -> Service:
        return self

    def call(self, *callers: str) -> None:
        self._waiting += callers

    def service_take_request(self, kind: type) -> tuple[Trigger.Request | None, str | None]:
        return (Trigger.Request(), self._waiting.pop(0)) if self._waiting else (None, None)

    def send_response(self, response: Trigger.Response, caller: str) -> None:
        self.responses.append((caller, response))


def finish_service(service: Service, session: Session, missing: str = "") -> FinishService:
    node: Any = SimpleNamespace(create_service=service.create)
    models: Any = SimpleNamespace(missing=missing)
    rigs: Any = SimpleNamespace(missing="")
    writer: Any = SimpleNamespace(folder=Path("result"), report=SimpleNamespace(alive=False, status=lambda: 0))
    return FinishService(node, session, models, rigs, writer)


def test_a_call_that_arrives_within_a_turn_waits_for_the_end_of_its_run() -> None:
    service, session = Service(), Session(last_answers=30.0, report=False)
    finish = finish_service(service, session)
    session.open(0.0)
    finish.work()
    assert not session.drain_if_due(0.0, finish.requested, rig_changed=False)
    service.call("caller")
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


def ended_run(session: Session, finish: FinishService) -> None:
    """A run that a caller ends, as far as its result."""
    session.open(0.0)
    finish.work()
    assert session.drain_if_due(0.1, finish.requested, rig_changed=False)
    finish.ending()
    finish.answer()


def test_samples_that_come_while_the_report_is_drawn_begin_a_run_that_goes_on() -> None:
    service, session = Service(), Session(last_answers=30.0, report=True)
    finish = finish_service(service, session)
    report: Any = finish._writer.report  # a fake, where `alive` is no property
    service.call("first")
    ended_run(session, finish)
    session.written()
    report.alive = True
    finish.answer()
    assert not service.responses and not finish.requested, "nobody waits for the end of the next run"
    session.open(0.2)
    assert not session.drain_if_due(0.3, finish.requested, rig_changed=False)
    finish.answer()
    assert not service.responses
    report.alive = False
    finish.answer()
    finish.answer()
    assert [caller for caller, _ in service.responses] == ["first"]
    service.call("second")
    finish.work()
    assert session.drain_if_due(0.4, finish.requested, rig_changed=False), "a later call ends the later run"


def test_callers_of_two_runs_are_answered_when_the_report_is_drawn() -> None:
    service, session = Service(), Session(last_answers=30.0, report=True)
    finish = finish_service(service, session)
    report: Any = finish._writer.report
    report.alive = True
    for caller in ("first", "second"):
        service.call(caller)
        ended_run(session, finish)
        session.written()
        finish.answer()
    service.call("third")
    finish.work()
    finish.answer()
    assert not service.responses
    report.alive = False
    finish.answer()
    assert sorted(caller for caller, _ in service.responses) == ["first", "second", "third"]


def test_a_caller_gets_the_failure_of_its_own_run() -> None:
    service, session = Service(), Session(last_answers=30.0, report=False)
    finish = finish_service(service, session)
    report: Any = finish._writer.report
    report.alive = True
    service.call("caller")
    ended_run(session, finish)
    session.failed("disk full")
    finish.answer()
    session.drain_if_due(0.2, finish_requested=True, rig_changed=False)
    session.written()
    report.alive = False
    finish.answer()
    assert [(r.success, r.message) for _, r in service.responses] == [(False, "disk full")]


def test_all_callers_get_the_reason_why_no_run_can_begin() -> None:
    service = Service()
    finish = finish_service(service, Session(last_answers=30.0, report=False), missing="no model")
    service.call("first", "second")
    finish.work()
    finish.answer()
    assert {caller for caller, _ in service.responses} == {"first", "second"}
    assert {(response.success, response.message) for _, response in service.responses} == {(False, "no model")}


def test_callers_of_two_turns_wait_for_the_same_run() -> None:
    service, session = Service(), Session(last_answers=30.0, report=False)
    finish = finish_service(service, session)
    session.open(0.0)
    for caller in ("first", "second"):
        service.call(caller)
        finish.work()
    assert session.drain_if_due(0.1, finish.requested, rig_changed=False)
    finish.ending()
    session.written()
    finish.answer()
    assert sorted(caller for caller, _ in service.responses) == ["first", "second"]


def test_without_samples_there_is_nothing_to_write() -> None:
    service = Service()
    finish = finish_service(service, Session(last_answers=30.0, report=False))
    service.call("caller")
    finish.work()
    finish.answer()
    assert not service.responses[0][1].success and "No sample" in service.responses[0][1].message


def test_the_end_of_the_node_answers_those_who_wait_for_a_report() -> None:
    service, session = Service(), Session(last_answers=30.0, report=True)
    finish = finish_service(service, session)
    writer: Any = finish._writer
    writer.report.alive = True
    writer.close = lambda: vars(writer.report).update(alive=False, status=lambda: 1)
    service.call("caller")
    ended_run(session, finish)
    session.written()
    finish.answer()
    assert not service.responses
    idle = SimpleNamespace(**dict.fromkeys(("look", "drain", "work", "models", "publish"), lambda *_: None))
    parts = {"_session": session, "_finish": finish, "_writer": writer, "_advance": lambda: None, "_run": None}
    others = dict.fromkeys(("_sensors", "_models", "_alarm", "_rigs", "_status"), idle)
    node: Any = SimpleNamespace(_closing=True, _closed=False, **parts, **others)
    PushValidator._work(node)
    assert node._closed
    ((caller, response),) = service.responses
    assert caller == "caller" and not response.success and "report failed" in response.message


def test_a_call_after_the_last_turn_is_answered_at_the_end() -> None:
    service, session = Service(), Session(last_answers=30.0, report=True)
    finish = finish_service(service, session)
    finish._writer.close = lambda: None
    service.call("caller")
    idle = SimpleNamespace(stop=lambda: None, close=lambda: None, why_nothing=lambda: "", warning=lambda _: None)
    parts = dict.fromkeys(("_alarm", "_sensors", "_status"), idle)
    node: Any = SimpleNamespace(
        _session=session, _finish=finish, _writer=finish._writer, _run=None, get_logger=lambda: idle, **parts
    )
    PushValidator.close(node)
    ((caller, response),) = service.responses
    assert caller == "caller" and not response.success and "No sample" in response.message
