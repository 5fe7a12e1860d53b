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


class Desk:
    """The service of a node with its session. It is its own middleware: it holds calls until the node takes them.

    answered: caller, success and message of each response.
    """

    srv_type = Trigger

    def __init__(self, missing: str = "") -> None:
        self.answered: list[tuple[str, bool, str]] = []
        self._waiting: list[str] = []
        self.handle, self.now = self, 0.0
        self.session = Session(last_answers=30.0, report=True)
        self.report = SimpleNamespace(alive=False, status=lambda: 0)
        self.writer: Any = SimpleNamespace(folder=Path("result"), report=self.report, close=lambda: None)
        node: Any = SimpleNamespace(create_service=lambda *_, **__: self)
        models, rigs = (SimpleNamespace(missing=text) for text in (missing, ""))
        self.finish = FinishService(node, self.session, models, rigs, self.writer)  # type: ignore[arg-type]  # fakes

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...

    def service_take_request(self, kind: type) -> tuple[Trigger.Request | None, str | None]:
        return (Trigger.Request(), self._waiting.pop(0)) if self._waiting else (None, None)

    def send_response(self, response: Trigger.Response, caller: str) -> None:
        self.answered.append((caller, response.success, response.message))

    def call(self, *callers: str) -> None:
        self._waiting += callers

    def turn(self, *callers: str) -> None:
        """A turn of the node after these calls: the session drains if a caller waits."""
        self.call(*callers)
        self.finish.work()
        self.now += 0.1
        if self.session.drain_if_due(self.now, self.finish.requested, rig_changed=False):
            self.finish.ending()
        self.finish.answer()

    def run_ends(self, caller: str) -> None:
        """A run that a caller ends, as far as its result."""
        self.session.open(self.now)
        self.turn(caller)
        assert not self.answered, "the run is draining"


def test_callers_of_several_turns_wait_for_the_end_of_the_same_run() -> None:
    desk = Desk()
    desk.session.open(0.0)
    desk.turn()
    desk.call("within a turn")
    desk.finish.answer()
    assert not desk.answered
    desk.turn("later")
    desk.turn("while it drains")
    assert not desk.answered
    desk.session.written()
    desk.finish.answer()
    assert sorted(desk.answered) == [(who, True, "result") for who in ("later", "while it drains", "within a turn")]
    assert not desk.finish.requested


def test_samples_that_come_while_the_report_is_drawn_begin_a_run_that_goes_on() -> None:
    desk = Desk()
    desk.run_ends("first")
    desk.session.written()
    desk.report.alive = True
    desk.finish.answer()
    desk.session.open(desk.now)
    desk.turn()
    assert not desk.answered and not desk.session.drain_if_due(9.0, desk.finish.requested, rig_changed=False)
    desk.report.alive = False
    desk.turn()
    desk.turn()
    assert [caller for caller, *_ in desk.answered] == ["first"]
    desk.turn("second")
    desk.session.written()
    desk.finish.answer()
    assert [caller for caller, *_ in desk.answered] == ["first", "second"], "a later call ends the later run"


def test_callers_of_two_runs_are_answered_when_the_report_is_drawn() -> None:
    desk = Desk()
    desk.report.alive = True
    for caller in ("first", "second"):
        desk.run_ends(caller)
        desk.session.written()
    desk.turn("third")
    assert not desk.answered
    desk.report.alive = False
    desk.turn()
    assert sorted(caller for caller, *_ in desk.answered) == ["first", "second", "third"]


def test_a_caller_gets_the_failure_of_its_own_run() -> None:
    desk = Desk()
    desk.report.alive = True
    desk.run_ends("caller")
    desk.session.failed("disk full")
    desk.finish.answer()
    desk.session.drain_if_due(9.0, finish_requested=True, rig_changed=False)
    desk.session.written()
    desk.report.alive = False
    desk.finish.answer()
    assert desk.answered == [("caller", False, "disk full")]


def test_all_callers_get_the_reason_why_no_run_can_begin() -> None:
    desk = Desk(missing="no model")
    desk.turn("first", "second")
    assert sorted(desk.answered) == [("first", False, "no model"), ("second", False, "no model")]


def test_the_end_of_the_node_answers_those_who_wait_for_a_report() -> None:
    desk = Desk()
    desk.report.alive = True
    desk.writer.close = lambda: vars(desk.report).update(alive=False, status=lambda: 1)
    desk.run_ends("caller")
    desk.session.written()
    desk.finish.answer()
    assert not desk.answered
    idle = SimpleNamespace(**dict.fromkeys(("look", "drain", "work", "models", "publish"), lambda *_: None))
    parts = {"_session": desk.session, "_finish": desk.finish, "_writer": desk.writer, "_run": None}
    others = dict.fromkeys(("_sensors", "_models", "_alarm", "_rigs", "_status"), idle)
    node: Any = SimpleNamespace(_closing=True, _closed=False, _advance=lambda: None, **parts, **others)
    PushValidator._work(node)
    assert node._closed
    ((caller, success, message),) = desk.answered
    assert caller == "caller" and not success and "report failed" in message


def test_a_call_after_the_last_turn_is_answered_at_the_end_and_without_samples_there_is_nothing_to_write() -> None:
    desk = Desk()
    desk.call("caller")
    idle: Any = SimpleNamespace(stop=lambda: None, close=lambda: None, why_nothing=lambda: "", warning=lambda _: None)
    parts = {"_session": desk.session, "_finish": desk.finish, "_writer": desk.writer, "_run": None}
    others = dict.fromkeys(("_alarm", "_sensors", "_status"), idle)
    PushValidator.close(SimpleNamespace(get_logger=lambda: idle, **parts, **others))  # type: ignore[arg-type]  # a fake
    ((caller, success, message),) = desk.answered
    assert caller == "caller" and not success and "No sample" in message
