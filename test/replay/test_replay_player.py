# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The play loop on a fake clock: which messages are published when, and what each control does."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from threading import Condition, Event, Thread
from time import sleep
from typing import Any, TypeAlias

import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_predictor.recordings.bag.reader import RawMessage
from push_predictor.replay.player import COARSE, SECOND, PlayerOutput, PlayRange, ReplayPlayer

START = 1000 * SECOND
Action: TypeAlias = "str | tuple[str, object]"  # a control, and its argument


def message(seconds: float, topic: str = "/t") -> RawMessage:
    return RawMessage(topic, "std_msgs/msg/String", START + round(seconds * SECOND), f"{seconds}".encode())


class ListSource:
    start = START

    def __init__(self, messages: list[RawMessage]) -> None:
        self.recorded = messages

    def messages(self, start: int) -> Iterator[RawMessage]:
        return (m for m in self.recorded if m.log_time >= start)


class Stage:
    """A player on fake time. script: {messages published: actions}; an endless wait closes the player."""

    def __init__(self, messages: list[RawMessage], **options: object) -> None:
        self.time = 0
        self.script: dict[int, list[Action]] = {}
        self.when_stuck: list[Action] = []
        self.answers: list[object] = []
        self.log: list[tuple[float, RawMessage]] = []
        self.prepared: list[tuple[float, RawMessage]] = []
        self.states: list[str] = []
        self.settled: list[int] = []
        self.slept: list[int] = []
        self.cost = 0
        self.refused: set[RawMessage] = set()
        output = PlayerOutput(self.prepare, lambda: self.settled.append(len(self.log)), self.states.append)
        source = options.pop("source", ListSource(messages))
        self.player = ReplayPlayer(source, output, **{"window": 10, "wall": self, **options})

    def now(self) -> int:
        return self.time

    def sleep(self, duration: int) -> None:
        self.slept.append(duration)
        self.time += duration

    def wait(self, condition: Condition, duration: int | None) -> None:
        if duration is not None:
            self.time += duration
            return
        assert condition is not None
        self.time += SECOND
        self.do(self.when_stuck.pop(0) if self.when_stuck else "close")

    def prepare(self, message: RawMessage) -> Callable[[], bool]:
        self.prepared.append((self.time / SECOND, message))
        return partial(self.publish, message)

    def publish(self, sent: RawMessage) -> bool:
        self.log.append((self.time / SECOND, sent))
        self.time += self.cost
        for action in self.script.pop(len(self.log), []):
            self.do(action)
        return sent not in self.refused

    def do(self, action: Action) -> None:
        name, *arguments = [action] if isinstance(action, str) else action
        self.answers.append(getattr(self.player, str(name))(*arguments))

    def run(self, what: PlayRange | None = None) -> list[float]:
        """Play, and return the recorded seconds of the published messages."""
        assert self.player.play(what or PlayRange())
        thread = Thread(target=self.player.run)
        thread.start()
        thread.join(10.0)
        assert not thread.is_alive(), "the player hangs"
        return self.seconds

    @property
    def seconds(self) -> list[float]:
        return [(m.log_time - START) / SECOND for _, m in self.log]

    @property
    def times(self) -> list[float]:
        return [wall for wall, _ in self.log]


TEN = [message(k / 10) for k in range(10)]
TENTHS = [k / 10 for k in range(10)]


@given(rate=st.floats(0.1, 50.0), gaps=st.lists(st.floats(0.0, 5.0), min_size=1, max_size=20))
def test_every_message_is_published_at_its_recorded_time_over_the_rate(rate: float, gaps: list[float]) -> None:
    at = [sum(gaps[: k + 1]) for k in range(len(gaps))]
    stage = Stage([message(t) for t in at], rate=rate)
    stage.run()
    assert stage.times == pytest.approx([t / rate for t in at], abs=1e-6)
    assert stage.states == ["playing", "finished"]
    assert stage.player.lateness.maximum <= 1


def test_publishing_takes_time_and_lateness_does_not_accumulate() -> None:
    stage = Stage(TEN)
    stage.cost = round(0.03 * SECOND)
    stage.run()
    assert stage.times == TENTHS
    assert len(stage.slept) == 9 and max(stage.slept) <= COARSE, "the last part of a wait is one plain sleep"


def test_slow_publisher_delays_messages_and_loses_none() -> None:
    stage = Stage(TEN)
    stage.cost = round(0.15 * SECOND)
    assert stage.run() == TENTHS
    assert stage.player.lateness.maximum == pytest.approx(0.45 * SECOND, rel=0.01)
    assert stage.player.published == 10


@pytest.mark.parametrize("controls", [[("set_rate", 0.5)], ["pause", "resume", ("set_rate", 0.5)]])
def test_at_another_rate_what_is_overdue_is_due_now(controls: list[Action]) -> None:
    stage = Stage(TEN)
    stage.cost = round(0.15 * SECOND)
    prepare = stage.prepare

    def hurried(message: RawMessage) -> Callable[[], bool]:
        if message is TEN[5] and stage.cost:
            stage.cost = 0
            for control in controls:
                stage.do(control)
            assert stage.player.behind == 0
        return prepare(message)

    stage.player._output = PlayerOutput(hurried, lambda: None, stage.states.append)
    stage.run()
    assert stage.times[:6] == pytest.approx([0.15 * k for k in range(6)])
    assert stage.times[5:] == pytest.approx([0.75 + 0.2 * k for k in range(5)])


def test_the_player_says_how_far_it_is_behind() -> None:
    stage, seen = Stage(TEN), list[float]()
    stage.cost = round(0.15 * SECOND)
    publish = stage.publish

    def watched(sent: RawMessage) -> bool:
        seen.append(stage.player.behind / SECOND)
        return publish(sent)

    stage.publish = watched  # type: ignore[method-assign]
    stage.run()
    assert seen == pytest.approx([0.05 * k for k in range(10)])


def test_a_seek_to_what_cannot_be_read_changes_nothing() -> None:
    class Broken(ListSource):
        def messages(self, start: int) -> Iterator[RawMessage]:
            if start == at(0.7):
                raise OSError("the disk is gone")
            return super().messages(start)

    stage = Stage(TEN, source=Broken(TEN))

    def fails() -> None:
        with pytest.raises(OSError, match="disk"):
            stage.player.seek(at(0.7))

    stage.player.fails = fails  # type: ignore[attr-defined]
    stage.script = {4: ["fails"]}
    assert stage.run() == TENTHS


def test_each_message_is_prepared_before_its_time() -> None:
    stage = Stage(TEN, rate=10.0)
    stage.run()
    assert [m for _, m in stage.prepared] == TEN
    assert [wall for wall, _ in stage.prepared] == pytest.approx([0.0, *stage.times[:-1]])


def test_a_message_that_cannot_be_published_counts_as_failed() -> None:
    stage = Stage(TEN)
    stage.refused = {TEN[3]}
    assert stage.run() == TENTHS
    assert (stage.player.published, stage.player.failed) == (9, 1)


@given(st.permutations(range(10)))
def test_messages_are_sorted_within_the_window(order: list[int]) -> None:
    stage = Stage([TEN[k] for k in order], window=10)
    assert stage.run() == TENTHS


def test_message_out_of_order_beyond_the_window_is_published() -> None:
    stage = Stage([*TEN[1:], TEN[0]], window=3)
    assert sorted(stage.run()) == TENTHS


def test_messages_of_equal_time_keep_their_order() -> None:
    stage = Stage([message(0.5, topic) for topic in ("/b", "/a", "/c")])
    stage.run()
    assert [m.topic for _, m in stage.log] == ["/b", "/a", "/c"]


@pytest.mark.parametrize(
    ("what", "expected"),
    [
        (PlayRange(offset=SECOND // 2), TENTHS[5:]),
        (PlayRange(duration=SECOND // 5), TENTHS[:3]),
        (PlayRange(until=START + SECOND // 10), TENTHS[:2]),
        (PlayRange(offset=SECOND // 2, duration=SECOND // 10), TENTHS[5:7]),
        (PlayRange(duration=SECOND // 10, until=START + SECOND // 2), TENTHS[:6]),  # the later of the two
        (PlayRange(offset=20 * SECOND), []),
    ],
)
def test_range_is_played_from_offset_to_end_inclusive(what: PlayRange, expected: list[float]) -> None:
    stage = Stage(TEN)
    assert stage.run(what) == expected
    assert stage.states[-1] == "finished"


def test_loop_over_an_empty_range_ends() -> None:
    assert Stage([], loop=True).run() == []


def test_finished_is_announced_after_subscribers_received_everything() -> None:
    stage = Stage(TEN)
    stage.run()
    assert stage.settled == [10]


@dataclass(frozen=True)
class Case:
    """Controls after so many messages, and in turn whenever the player would wait for ever, each a second later."""

    played: list[float]
    times: list[float]
    states: str = "playing finished"
    script: dict[int, list[Action]] = field(default_factory=dict)
    stuck: tuple[Action, ...] = ()
    answers: tuple[object, ...] = ()
    options: dict[str, Any] = field(default_factory=dict)
    what: PlayRange = field(default_factory=PlayRange)


def at(seconds: float) -> int:
    return START + round(seconds * SECOND)


PAUSED = {"paused": True}
CASES = {
    "an offset adds no waiting": Case([0.8, 0.9], [0.0, 0.1], what=PlayRange(offset=8 * SECOND // 10)),
    "a delay comes before each loop": Case(
        [0.0, 0.1] * 2, [3.0, 3.1, 6.1, 6.2], script={4: ["stop"]},
        options={"loop": True, "delay": 3 * SECOND, "source": ListSource(TEN[:2])},
    ),
    "a pause stops the time": Case(
        TENTHS, [0.0, 0.1, 0.2, *(1.0 + k / 10 for k in range(3, 10))], "playing paused playing finished",
        {3: ["pause"]}, ("resume",),
    ),
    "play_next and burst publish at once": Case(
        TENTHS, [1.0] + [2.0] * 3 + [3.0] * 6, "paused finished", {}, ("play_next", ("burst", 3), ("burst", 0)),
        (True, 3, 6), PAUSED,
    ),
    "a seek keeps a pause": Case(
        [0.8, 0.9], [2.0, 2.0], "paused finished", {}, (("seek", at(0.8)), ("burst", 0)), (None, 2), PAUSED
    ),
    "messages after a burst keep their pace": Case(
        TENTHS, [1.0] * 5 + [2.1, 2.2, 2.3, 2.4, 2.5], "paused playing finished", {}, (("burst", 5), "resume"),
        options=PAUSED,
    ),
    "play_next and burst do nothing while playing": Case(
        TENTHS, TENTHS, script={2: ["play_next", ("burst", 3)]}, answers=(False, 0)
    ),
    "a seek goes forward and back without waiting": Case(
        [0.0, 0.1, 0.8, 0.9, 0.9], [0.0, 0.1, 0.1, 0.2, 0.2], script={2: [("seek", at(0.8))], 4: [("seek", at(0.9))]}
    ),
    "a seek before the start goes to the start": Case(
        [0.0, 0.1, *TENTHS], [0.0, 0.1, *(0.1 + k / 10 for k in range(10))], script={2: [("seek", 0)]}
    ),
    "a seek after the end plays from there": Case(
        [*TENTHS, 0.8, 0.9], [*TENTHS, 1.9, 2.0], "playing finished playing finished", {}, (("seek", at(0.8)),)
    ),
    "play starts only when nothing is playing": Case(
        [*TENTHS, 0.8, 0.9], [*TENTHS, 1.9, 2.0], "playing finished playing finished", {2: [("play", PlayRange())]},
        (("play", PlayRange(offset=8 * SECOND // 10)),), (False, True),
    ),
    "stop ends the playback": Case(TENTHS[:4], TENTHS[:4], script={4: ["stop"]}),
    "stop ends a pause": Case([], [], "paused finished", {}, ("stop",), options=PAUSED),
    "a new rate applies from the next message": Case(
        TENTHS, [0.0, 0.1, 0.2, 0.3, 0.4, 0.41, 0.42, 0.43, 0.44, 0.45], script={5: [("set_rate", 10.0)]}
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_controls(name: str) -> None:
    case = CASES[name]
    stage = Stage(TEN, **case.options)
    stage.script, stage.when_stuck = dict(case.script), list(case.stuck)
    assert stage.run(case.what) == case.played
    assert stage.times == pytest.approx(case.times) and stage.states == case.states.split()
    assert tuple(stage.answers[: len(case.answers)]) == case.answers


@pytest.mark.parametrize(
    ("control", "expected", "published"),
    [
        (lambda player: player.seek(START + 8 * SECOND // 10), 4, [0.0, 0.1, 0.8, 0.9]),
        (lambda player: player.seek(START + 2 * SECOND), 2, [0.0, 0.1]),
    ],
    ids=["to a message", "behind the last"],
)
def test_a_burst_goes_on_where_a_seek_leads_while_it_waits(
    control: Callable[[ReplayPlayer], None], expected: int, published: list[float]
) -> None:
    stage = Stage(TEN, paused=True)
    prepare = stage.prepare

    def prepare_and_seek(message: RawMessage) -> Callable[[], bool]:
        if message is TEN[2]:
            control(stage.player)
        return prepare(message)

    output = PlayerOutput(prepare_and_seek, lambda: None, lambda state: None)
    stage.player = ReplayPlayer(ListSource(TEN), output, 10, paused=True, wall=stage)
    stage.when_stuck = [("burst", 0)]
    assert stage.run() == published
    assert stage.answers[0] == expected


def test_controls_work_while_a_burst_waits_for_a_subscriber_that_hangs() -> None:
    waits, hung, published = Event(), Event(), []

    def prepare(message: RawMessage) -> Callable[[], bool]:
        if message is TEN[2] and not hung.is_set():
            waits.set()
            hung.wait(20.0)
        return lambda: not published.append(message)

    output = PlayerOutput(prepare, lambda: None, lambda state: None)
    player = ReplayPlayer(ListSource(TEN), output, 10, rate=1e6, paused=True)
    playing, answers = Thread(target=player.run, daemon=True), []
    playing.start()
    player.play(PlayRange())
    while player.state != "paused":
        sleep(0.01)
    bursting = Thread(target=lambda: answers.append(player.burst(0)), daemon=True)
    bursting.start()
    assert waits.wait(20.0)
    others = [Thread(target=control, daemon=True) for control in (lambda: player.behind, player.resume)]
    for other in others:
        other.start()
        other.join(20.0)
    free = [not other.is_alive() for other in others]
    hung.set()
    bursting.join(20.0)
    while player.state != "finished" and free == [True, True]:
        sleep(0.01)
    player.close()
    assert free == [True, True], "the burst held the player's lock"
    assert published == TEN and answers == [2], "the burst ends where the replay is resumed"


@pytest.mark.parametrize(
    ("control", "published"),
    [(("seek", START + 8 * SECOND // 10), [0.0, 0.1, 0.8, 0.9]), ("stop", [0.0, 0.1]), ("pause", [0.0, 0.1])],
)
def test_a_control_just_after_the_sleep_keeps_the_message_back(
    control: str | tuple[str, object], published: list[float]
) -> None:
    stage = Stage(TEN)

    class Wall:
        now, wait = stage.now, stage.wait

        def sleep(self, duration: int) -> None:
            stage.sleep(duration)
            if len(stage.log) == 2 and len(stage.slept) == 2:
                stage.do(control)

    output = PlayerOutput(stage.prepare, lambda: None, lambda state: None)
    stage.player = ReplayPlayer(ListSource(TEN), output, 10, wall=Wall())
    assert stage.run() == published


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_rejects_rate_that_is_not_positive(rate: float) -> None:
    stage = Stage(TEN)
    assert not stage.player.set_rate(rate)
    assert stage.player.rate == 1.0


def test_clock_never_passes_the_next_message() -> None:
    stage = Stage(TEN)
    stage.cost = SECOND
    seen: list[int | None] = []

    def look(message: RawMessage) -> Callable[[], bool]:
        stage.player.report_time(seen.append)  # late by now: the clock alone would be far ahead
        return partial(stage.publish, message)

    stage.player._output = PlayerOutput(look, lambda: stage.player.report_time(seen.append), stage.states.append)
    stage.run()
    assert seen == [*(m.log_time for m in TEN), TEN[-1].log_time]


@pytest.mark.parametrize("options", [{}, {"delay": 60 * SECOND}])
def test_the_end_wakes_a_long_sleep(options: dict[str, int]) -> None:
    published: list[RawMessage] = []
    output = PlayerOutput(lambda m: lambda: not published.append(m), lambda: None, lambda state: None)
    player = ReplayPlayer(ListSource([message(0.0), message(60.0)]), output, 10, **options)
    playing = Thread(target=player.run, daemon=True)
    playing.start()
    player.play(PlayRange())
    while not (published or options):
        sleep(0.01)
    sleep(0.05)
    player.close()
    playing.join(10.0)
    assert not playing.is_alive() and len(published) == (0 if options else 1)
