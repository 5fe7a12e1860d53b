# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What each event does in each state of a run; the times are seconds of a made-up clock."""

from __future__ import annotations

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


def waiting() -> Session:
    return Session(LAST_ANSWERS, report=True)


def opened() -> Session:
    session = waiting()
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


IN_EVERY_STATE = [
    pytest.param(make, state, id=state.value)
    for make, state in ((waiting, State.WAITING), (opened, State.OPEN), (draining, State.DRAINING),
                        (written, State.WRITTEN))
]  # fmt: skip
INACTIVE = [pytest.param(waiting, id="waiting"), pytest.param(written, id="written")]


def due(session: Session, now: float = BEGIN, finish_requested: bool = False, rig_changed: bool = False) -> bool:
    return session.drain_if_due(now, finish_requested, rig_changed)


def patience(session: Session, begin: float = BEGIN) -> float:
    """Seconds for which a draining session waits for an answer, to 0.1 s."""
    steps = (k for k in range(10_000) if session.answers_settled(begin + 0.1 * k, open_requests=1))
    return 0.1 * next(steps)


# --- states ----------------------------------------------------------------------------------------------------------


def test_a_run_goes_from_waiting_through_open_and_draining_to_written() -> None:
    session = waiting()
    assert (session.state, session.active) == (State.WAITING, False)
    session.open(BEGIN)
    assert (session.state, session.active) == (State.OPEN, True)
    assert due(session, finish_requested=True)
    assert (session.state, session.active) == (State.DRAINING, True)
    session.written()
    assert (session.state, session.active, session.failure) == (State.WRITTEN, False, "")


@pytest.mark.parametrize("make", [opened, draining])
def test_only_an_inactive_session_opens(make) -> None:
    with pytest.raises(AssertionError):
        make().open(BEGIN)


@pytest.mark.parametrize(("make", "state"), IN_EVERY_STATE)
def test_a_sample_or_a_status_of_the_replay_alone_changes_no_state(make, state: State) -> None:
    session = make()
    for status in ("playing", "paused", "finished"):
        session.replay(status, samples_waiting=True)
        session.sample(BEGIN + 1.0)
        assert session.state is state


@pytest.mark.parametrize("make", [waiting, draining, written])
def test_only_an_open_session_drains(make) -> None:
    session = make()
    session.replay("finished", samples_waiting=True)
    before = session.state
    assert not due(session, BEGIN + 100.0, finish_requested=True, rig_changed=True)
    assert session.state is before


@pytest.mark.parametrize("make", [waiting, opened, written])
def test_only_a_draining_session_is_written_or_fails(make) -> None:
    with pytest.raises(AssertionError):
        make().written()
    with pytest.raises(AssertionError):
        make().failed("disk full")


# --- what ends a run -------------------------------------------------------------------------------------------------


def test_an_open_session_stays_open_while_samples_arrive_and_nobody_asks() -> None:
    assert not due(opened(), BEGIN + 1e6)


def test_a_finished_replay_ends_the_run_once_no_sample_follows() -> None:
    session = opened()
    session.sample(BEGIN + 10.0)
    session.replay("finished", samples_waiting=False)
    assert not due(session, BEGIN + 10.0 + 0.9 * QUIET)
    session.sample(BEGIN + 10.1)
    assert not due(session, BEGIN + 10.1 + 0.9 * QUIET)
    assert due(session, BEGIN + 10.1 + 1.1 * QUIET)
    assert session.with_report
    assert patience(session, BEGIN + 10.1 + 1.1 * QUIET) == pytest.approx(LAST_ANSWERS, abs=0.11)


def test_a_replay_that_continues_cancels_the_end_of_the_run() -> None:
    session = opened()
    session.replay("finished", samples_waiting=False)
    session.replay("playing", samples_waiting=False)
    assert not due(session, BEGIN + 100.0)


@pytest.mark.parametrize("make", INACTIVE)
def test_a_replay_that_finished_before_the_first_sample_ends_nothing(make) -> None:
    session = make()
    session.replay("finished", samples_waiting=False)
    session.open(BEGIN)
    assert not due(session, BEGIN + 100.0)


@pytest.mark.parametrize("make", INACTIVE)
def test_a_replay_that_finished_while_its_samples_waited_ends_their_run(make) -> None:
    session = make()
    session.replay("finished", samples_waiting=True)
    session.open(BEGIN)
    assert due(session, BEGIN + 1.1 * QUIET)


def test_a_caller_waits_five_seconds_for_answers_and_gets_the_report() -> None:
    session = opened()
    assert due(session, finish_requested=True)
    assert session.with_report
    assert patience(session) == pytest.approx(CALLER_PATIENCE, abs=0.11)


def test_no_report_is_written_if_the_parameter_is_false() -> None:
    session = Session(LAST_ANSWERS, report=False)
    session.open(BEGIN)
    assert due(session, finish_requested=True)
    assert not session.with_report


def test_another_rig_ends_the_run_without_a_report() -> None:
    session = opened()
    assert due(session, rig_changed=True)
    assert not session.with_report
    assert patience(session) == pytest.approx(CALLER_PATIENCE, abs=0.11)


# --- draining --------------------------------------------------------------------------------------------------------


def test_a_draining_session_waits_for_answers_until_the_deadline() -> None:
    session = draining()
    assert session.answers_settled(BEGIN, open_requests=0)
    assert not session.answers_settled(BEGIN + 0.9 * CALLER_PATIENCE, open_requests=1)
    assert session.answers_settled(BEGIN + CALLER_PATIENCE, open_requests=1)


def test_a_draining_session_waits_longer_for_the_alarm() -> None:
    session, late = draining(), BEGIN + CALLER_PATIENCE + ALARM_PATIENCE
    assert session.alarm_settled(BEGIN, busy=False)
    assert not session.alarm_settled(late - 0.1, busy=True)
    assert session.alarm_settled(late, busy=True)


def test_a_result_that_cannot_be_written_is_tried_again_on_the_next_call_of_finish() -> None:
    session = draining()
    session.failed("disk full")
    assert (session.state, session.failure) == (State.OPEN, "disk full")
    assert not due(session, BEGIN + 100.0)
    assert due(session, BEGIN + 100.0, finish_requested=True)
    session.written()
    assert (session.state, session.failure) == (State.WRITTEN, "")


# --- the next run ----------------------------------------------------------------------------------------------------


def test_a_second_replay_is_a_new_run_with_a_deadline_of_its_own() -> None:
    session = opened()
    session.replay("finished", samples_waiting=False)
    assert due(session, BEGIN + 1.0)
    session.written()
    session.open(BEGIN + 50.0)
    assert not due(session, BEGIN + 60.0), "the end of the first replay does not end the second"
    session.replay("playing", samples_waiting=True)
    session.replay("finished", samples_waiting=False)
    assert due(session, BEGIN + 70.0)
    assert patience(session, BEGIN + 70.0) == pytest.approx(LAST_ANSWERS, abs=0.11)


def test_a_new_run_forgets_the_failure_of_the_last() -> None:
    session = draining()
    session.shut_down(BEGIN)
    session.failed("disk full")
    session.open(BEGIN + 1.0)
    assert session.failure == ""


# --- silence ---------------------------------------------------------------------------------------------------------


def test_an_open_session_without_samples_is_silent_after_five_seconds() -> None:
    session = opened()
    assert not session.silent(BEGIN + 0.9 * SILENCE)
    assert session.silent(BEGIN + SILENCE)
    session.sample(BEGIN + SILENCE)
    assert not session.silent(BEGIN + 1.9 * SILENCE)


def test_a_paused_replay_is_not_silent() -> None:
    session = opened()
    session.replay("paused", samples_waiting=False)
    assert not session.silent(BEGIN + 100.0)
    session.replay("playing", samples_waiting=False)
    assert session.silent(BEGIN + 100.0)


@pytest.mark.parametrize("make", [waiting, draining, written])
def test_only_an_open_session_is_silent(make) -> None:
    assert not make().silent(BEGIN + 100.0)


# --- shutdown --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", INACTIVE)
def test_a_session_with_nothing_to_write_is_over_at_shutdown(make) -> None:
    session = make()
    assert not session.over
    session.shut_down(BEGIN)
    assert session.over


def test_an_open_session_is_written_at_shutdown_without_report_and_with_little_patience() -> None:
    session = opened()
    session.shut_down(BEGIN)
    assert not session.over
    assert due(session, finish_requested=True)
    assert not session.with_report and patience(session) == pytest.approx(SHUTDOWN_PATIENCE, abs=0.11)
    session.written()
    assert session.over


def test_shutdown_shortens_the_patience_of_a_draining_session_once() -> None:
    session = opened()
    session.replay("finished", samples_waiting=False)
    assert due(session, BEGIN + 1.0)
    for second in (2.0, 3.0, 3.9):
        session.shut_down(BEGIN + second)
    assert not session.with_report
    assert patience(session, BEGIN + 2.0) == pytest.approx(SHUTDOWN_PATIENCE, abs=0.11)
    assert session.alarm_settled(BEGIN + 4.0, busy=True), "the alarm gets no time of its own"


def test_shutdown_never_lengthens_the_patience() -> None:
    session = draining()
    session.shut_down(BEGIN + CALLER_PATIENCE - 0.5)
    assert session.answers_settled(BEGIN + CALLER_PATIENCE, open_requests=1)


def test_a_result_that_cannot_be_written_at_shutdown_is_given_up_with_the_reason() -> None:
    session = opened()
    session.shut_down(BEGIN)
    assert due(session)
    session.failed("disk full")
    assert session.over and session.failure == "disk full"
