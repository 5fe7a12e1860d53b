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
    """Calls the node's callback as an executor does, and holds the responses."""

    def __init__(self) -> None:
        self.responses: list[tuple[str, Trigger.Response]] = []
        self.callback: Any = None
        self._waiting: list[tuple[str, Any]] = []

    def create(self, kind: type, name: str, callback: Any, callback_group: object) -> None:
        self.callback = callback

    def call(self, *callers: str) -> None:
        self._waiting += [(caller, self.callback(Trigger.Request(), Trigger.Response())) for caller in callers]
        self.turn()

    def turn(self) -> None:
        """Resume all callbacks that wait, as each turn of an executor does."""
        for caller, callback in [*self._waiting]:
            try:
                callback.send(None)
            except StopIteration as end:
                self._waiting.remove((caller, callback))
                self.responses.append((caller, end.value))


def finish_service(service: Service, session: Session, missing: str = "") -> FinishService:
    node: Any = SimpleNamespace(create_service=service.create)
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
    service.call("caller")
    finish.answer()
    service.turn()
    assert not service.responses
    finish.work()
    assert session.drain_if_due(0.1, finish.requested, rig_changed=False)
    finish.answer()
    service.turn()
    assert not service.responses, "the run is draining"
    session.written()
    finish.answer()
    assert not finish.sent, "the executor has had no turn since"
    service.turn()
    assert finish.sent
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
    report: Any = finish._writer.report  # a fake, where `busy` is no property
    service.call("first")
    ended_run(session, finish)
    session.written()
    report.busy = True
    finish.answer()
    service.turn()
    assert not service.responses and not finish.requested, "nobody waits for the end of the next run"
    session.open(0.2)
    assert not session.drain_if_due(0.3, finish.requested, rig_changed=False)
    finish.answer()
    service.turn()
    assert not service.responses
    report.busy = False
    finish.answer()
    service.turn()
    finish.answer()
    service.turn()
    assert [caller for caller, _ in service.responses] == ["first"]
    service.call("second")
    finish.work()
    assert session.drain_if_due(0.4, finish.requested, rig_changed=False), "a later call ends the later run"


def test_callers_of_two_runs_are_answered_when_the_report_is_drawn() -> None:
    service, session = Service(), Session(last_answers=30.0, report=True)
    finish = finish_service(service, session)
    report: Any = finish._writer.report
    report.busy = True
    for caller in ("first", "second"):
        service.call(caller)
        ended_run(session, finish)
        session.written()
        finish.answer()
        service.turn()
    service.call("third")
    finish.work()
    finish.answer()
    service.turn()
    assert not service.responses
    report.busy = False
    finish.answer()
    service.turn()
    assert sorted(caller for caller, _ in service.responses) == ["first", "second", "third"]


def test_a_caller_gets_the_failure_of_its_own_run() -> None:
    service, session = Service(), Session(last_answers=30.0, report=False)
    finish = finish_service(service, session)
    report: Any = finish._writer.report
    report.busy = True
    service.call("caller")
    ended_run(session, finish)
    session.failed("disk full")
    finish.answer()
    service.turn()
    session.drain_if_due(0.2, finish_requested=True, rig_changed=False)
    session.written()
    report.busy = False
    finish.answer()
    service.turn()
    assert [(r.success, r.message) for _, r in service.responses] == [(False, "disk full")]


def test_all_callers_get_the_reason_why_no_run_can_begin() -> None:
    service = Service()
    finish = finish_service(service, Session(last_answers=30.0, report=False), missing="no model")
    service.call("first", "second")
    finish.work()
    finish.answer()
    service.turn()
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
    service.turn()
    assert sorted(caller for caller, _ in service.responses) == ["first", "second"]


def test_without_samples_there_is_nothing_to_write() -> None:
    service = Service()
    finish = finish_service(service, Session(last_answers=30.0, report=False))
    service.call("caller")
    finish.work()
    finish.answer()
    service.turn()
    assert not service.responses[0][1].success and "No sample" in service.responses[0][1].message


def test_the_end_of_the_node_answers_those_who_wait_for_a_report() -> None:
    service, session = Service(), Session(last_answers=30.0, report=True)
    finish = finish_service(service, session)
    writer: Any = finish._writer
    writer.report.busy = True
    writer.close = lambda: vars(writer.report).update(busy=False, failed=True)
    service.call("caller")
    ended_run(session, finish)
    session.written()
    finish.answer()
    service.turn()
    assert not service.responses
    idle = SimpleNamespace(**dict.fromkeys(("look", "drain", "work", "models", "publish"), lambda *_: None))
    parts = {"_session": session, "_finish": finish, "_writer": writer, "_advance": lambda: None, "_run": None}
    others = dict.fromkeys(("_sensors", "_models", "_alarm", "_rigs", "_status"), idle)
    node: Any = SimpleNamespace(_closing=True, _closed=False, **parts, **others)
    PushValidator._work(node)
    assert node._closed and not finish.sent
    service.turn()
    assert finish.sent
    ((caller, response),) = service.responses
    assert caller == "caller" and not response.success and "report failed" in response.message
