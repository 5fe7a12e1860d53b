# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What each event does in each state of a run; the times are seconds of a made-up clock."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from push_predictor.online.session import (
    ALARM_PATIENCE,
    CALLER_PATIENCE,
    QUIET,
    SHUTDOWN_PATIENCE,
    SILENCE,
    Session,
    State,
)

BEGIN = 100.0
LAST_ANSWERS = 30.0


def waiting(report: bool = True) -> Session:
    return Session(LAST_ANSWERS, report)


def opened(report: bool = True) -> Session:
    session = waiting(report)
    session.open(BEGIN)
    return session


def draining() -> Session:
    session = opened()
    assert due(session, finish_requested=True)
    return session


def written() -> Session:
    session = draining()
    session.written()
    return session


Make = Callable[[], Session]
STATES: dict[Make, State] = {
    waiting: State.WAITING,
    opened: State.OPEN,
    draining: State.DRAINING,
    written: State.WRITTEN,
}
inactive = pytest.mark.parametrize("make", [waiting, written])


def due(session: Session, now: float = BEGIN, finish_requested: bool = False, rig_changed: bool = False) -> bool:
    return session.drain_if_due(now, finish_requested, rig_changed)


def patience(session: Session, begin: float = BEGIN) -> float:
    """Seconds for which a draining session waits for an answer, to 0.1 s; without open requests it does not wait."""
    assert session.answers_settled(begin, open_requests=0)
    steps = (k for k in range(10_000) if session.answers_settled(begin + 0.1 * k, open_requests=1))
    return 0.1 * next(steps)


# --- states ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("make", "state"), STATES.items())
def test_only_the_event_of_a_state_changes_it(make: Make, state: State) -> None:
    session = make()
    for status in ("playing", "paused", "finished"):
        session.replay(status, samples_waiting=True)
        session.sample(BEGIN + 1.0)
    assert session.state is state and session.active == (state in (State.OPEN, State.DRAINING))
    assert session.silent(BEGIN + 100.0) == (state is State.OPEN)
    if state is not State.OPEN:
        assert not due(session, BEGIN + 100.0, finish_requested=True, rig_changed=True) and session.state is state
    if session.active:
        with pytest.raises(AssertionError):
            make().open(BEGIN)
    for end in (Session.written, lambda session: session.failed("disk full")):
        if state is not State.DRAINING:
            with pytest.raises(AssertionError):
                end(make())


def test_an_open_session_stays_open_while_samples_arrive_and_nobody_asks() -> None:
    assert not due(opened(), BEGIN + 1e6)


# --- what ends a run -------------------------------------------------------------------------------------------------


def test_a_finished_replay_ends_the_run_once_no_sample_follows() -> None:
    session = opened()
    session.sample(BEGIN + 10.0)
    session.replay("finished", samples_waiting=False)
    assert not due(session, BEGIN + 10.0 + 0.9 * QUIET)
    session.sample(end := BEGIN + 10.1)
    assert not due(session, end + 0.9 * QUIET)
    assert due(session, end + 1.1 * QUIET) and session.with_report
    assert patience(session, end + 1.1 * QUIET) == pytest.approx(LAST_ANSWERS, abs=0.11)


def test_a_replay_that_continues_cancels_the_end_of_the_run() -> None:
    session = opened()
    session.replay("finished", samples_waiting=False)
    session.replay("playing", samples_waiting=False)
    assert not due(session, BEGIN + 100.0)


@inactive
@pytest.mark.parametrize("samples_waiting", [False, True])
def test_a_replay_that_finished_earlier_ends_the_run_of_samples_that_waited(make: Make, samples_waiting: bool) -> None:
    session = make()
    session.replay("finished", samples_waiting)
    session.open(BEGIN)
    assert due(session, BEGIN + (1.1 * QUIET if samples_waiting else 100.0)) == samples_waiting


@pytest.mark.parametrize(
    ("event", "report", "with_report"),
    [("finish_requested", True, True), ("finish_requested", False, False), ("rig_changed", True, False)],
)
def test_a_caller_and_another_rig_end_the_run_at_once(event: str, report: bool, with_report: bool) -> None:
    session = opened(report)
    assert due(session, **{event: True}) and session.with_report == with_report
    assert patience(session) == pytest.approx(CALLER_PATIENCE, abs=0.11)


def test_a_draining_session_waits_longer_for_the_alarm() -> None:
    session, late = draining(), BEGIN + CALLER_PATIENCE + ALARM_PATIENCE
    assert session.alarm_settled(BEGIN, busy=False)
    assert not session.alarm_settled(late - 0.1, busy=True) and session.alarm_settled(late, busy=True)


def test_a_result_that_cannot_be_written_is_tried_again_on_the_next_call_of_finish() -> None:
    session = draining()
    session.failed("disk full")
    assert (session.state, session.failure) == (State.OPEN, "disk full")
    assert not due(session, BEGIN + 100.0) and due(session, BEGIN + 100.0, finish_requested=True)
    session.written()
    assert (session.state, session.failure) == (State.WRITTEN, "")


def test_a_second_replay_is_a_new_run_with_a_deadline_of_its_own() -> None:
    session = opened()
    session.replay("finished", samples_waiting=False)
    assert due(session, BEGIN + 1.0)
    session.written()
    session.open(BEGIN + 50.0)
    assert not due(session, BEGIN + 60.0), "the end of the first replay does not end the second"
    session.replay("playing", samples_waiting=True)
    session.replay("finished", samples_waiting=False)
    assert due(session, BEGIN + 70.0) and patience(session, BEGIN + 70.0) == pytest.approx(LAST_ANSWERS, abs=0.11)


def test_a_session_without_samples_is_silent_after_five_seconds_unless_the_replay_is_paused() -> None:
    session = opened()
    for begin in (BEGIN, BEGIN + SILENCE):
        session.sample(begin)
        assert not session.silent(begin + 0.9 * SILENCE) and session.silent(begin + SILENCE)
    session.replay("paused", samples_waiting=False)
    assert not session.silent(BEGIN + 100.0)


# --- shutdown --------------------------------------------------------------------------------------------------------


@inactive
def test_a_session_with_nothing_to_write_is_over_at_shutdown(make: Make) -> None:
    session = make()
    assert not session.over
    session.shut_down(BEGIN)
    assert session.over


@pytest.mark.parametrize("failure", ["", "disk full"])
def test_an_open_session_is_written_at_shutdown_or_given_up_with_the_reason(failure: str) -> None:
    session = opened()
    session.shut_down(BEGIN)
    assert not session.over
    assert due(session, finish_requested=True)
    assert not session.with_report and patience(session) == pytest.approx(SHUTDOWN_PATIENCE, abs=0.11)
    if failure:
        session.failed(failure)
    else:
        session.written()
    assert session.over and session.failure == failure
    session.open(BEGIN + 1.0)
    assert session.failure == "", "of the last run"


def test_shutdown_shortens_the_patience_of_a_draining_session_once() -> None:
    session = opened()
    session.replay("finished", samples_waiting=False)
    assert due(session, BEGIN + 1.0)
    for second in (2.0, 3.0, 3.9):
        session.shut_down(BEGIN + second)
    assert not session.with_report and patience(session, BEGIN + 2.0) == pytest.approx(SHUTDOWN_PATIENCE, abs=0.11)
    assert session.alarm_settled(BEGIN + 4.0, busy=True), "the alarm gets no time of its own"
    late = draining()
    late.shut_down(BEGIN + CALLER_PATIENCE - 0.5)
    assert late.answers_settled(BEGIN + CALLER_PATIENCE, open_requests=1), "it never lengthens it"
