# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The player of a replay: peek, sleep until the message's time, publish, pop. Every control is a public method."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from push_predictor.recordings.bag.reader import RawMessage
from push_predictor.replay.report import Lateness
from push_predictor.replay.source import BagSource, sorted_within

SECOND = 1_000_000_000
COARSE = 20_000_000  # ns: a longer sleep waits on a condition that a control notifies; the rest is one plain sleep


class SystemClock:
    """The machine's steady clock, the one of perf_counter; tests replace it by a fake."""

    def now(self) -> int:
        """Steady time, ns."""
        return time.perf_counter_ns()

    def sleep(self, duration: int) -> None:
        """Sleep for so many ns."""
        time.sleep(duration / SECOND)

    def wait(self, condition: threading.Condition, duration: int | None) -> None:
        """Wait on a locked condition, at most so many ns."""
        condition.wait(None if duration is None else duration / SECOND)


class PlayerClock:
    """Recorded time, ns: it runs at a rate, pauses and jumps.

    Deadlines are absolute: they follow from one pair (recorded time, wall time), which only a control replaces.
    Lateness therefore never accumulates.
    """

    def __init__(self, wall: SystemClock, rate: float, paused: bool) -> None:
        self._wall, self.rate, self.paused = wall, rate, paused
        self._recorded, self._at = 0, wall.now()

    def now(self) -> int:
        """Recorded time, ns."""
        return self._recorded if self.paused else self._recorded + round((self._wall.now() - self._at) * self.rate)

    def deadline(self, recorded: int) -> int:
        """The wall time of a recorded time, ns, if no control comes before."""
        return self._at + round((recorded - self._recorded) / self.rate)

    def jump(self, recorded: int) -> None:
        """Continue from another recorded time."""
        self._recorded, self._at = recorded, self._wall.now()

    def change(self, recorded: int, rate: float | None = None, paused: bool | None = None) -> None:
        """Run at another rate, stop or go on, from a recorded time."""
        self.jump(recorded)
        self.rate = self.rate if rate is None else rate
        self.paused = self.paused if paused is None else paused


@dataclass(frozen=True)
class PlayRange:
    """The part to play, in ns: offset from the first message, duration from there, until (a log time).

    A limit of None is no limit. Of two limits the later one applies, as in rosbag2.
    """

    offset: int = 0
    duration: int | None = None
    until: int | None = None

    def first(self, start: int) -> int:
        """Log time of the beginning, for a source that starts at `start`."""
        return start + self.offset

    def last(self, start: int) -> int | None:
        """Log time of the end, inclusive; None for no limit."""
        ends = [self.until] if self.until is not None else []
        ends += [self.first(start) + self.duration] if self.duration is not None else []
        return max(ends, default=None)


@dataclass(frozen=True)
class PlayerOutput:
    """The callbacks of a player.

    prepare: do all that a message requires before its time, and return the call that publishes it, False if that
    failed. It waits until subscribers have received what the message would overwrite; controls still work meanwhile.
    A message may be prepared more than once. settle: wait until subscribers have received everything. announce: take
    the new state: playing, paused or finished.
    """

    prepare: Callable[[RawMessage], Callable[[], bool]]
    settle: Callable[[], None]
    announce: Callable[[str], None]


class ReplayPlayer:
    """Plays a source by a clock. run() takes a thread; all other methods may be called from any thread.

    window: how many messages are read ahead and sorted. delay: ns before each loop. Messages are never dropped: a late
    one is published at once. published and failed count messages. lateness: delay up to the call that publishes one.
    """

    def __init__(
        self,
        source: BagSource,
        output: PlayerOutput,
        window: int,
        *,
        rate: float = 1.0,
        paused: bool = False,
        loop: bool = False,
        delay: int = 0,
        wall: SystemClock = SystemClock(),
    ) -> None:
        self._source, self._output, self._wall = source, output, wall
        self._window, self._loop, self._delay = window, loop, delay
        self._clock = PlayerClock(wall, rate, paused)
        self._changed = threading.Condition(threading.RLock())
        self._waiting, self._counting = 0, threading.Lock()
        self._ahead: Iterator[RawMessage] | None = None
        self._next: RawMessage | None = None
        self._range = PlayRange()
        self._start_at: int | None = None
        self._stopped = self._closed = False
        self._time: int | None = None
        self.state = "waiting"
        self.lateness = Lateness()
        self.published = self.failed = 0

    def run(self) -> None:
        """Play whenever play() or seek() is called, until close()."""
        while (position := self._next_position()) is not None:
            while self._wait_delay() and self._play_through(position) and self._loop:
                position = self._range.first(self._source.start)
            self._finish()

    def play(self, what: PlayRange) -> bool:
        """Play a range from its start. False if a playback is already running."""
        with self._control():
            if self._busy:
                return False
            self._range = what
            self._start_at = what.first(self._source.start)
        return True

    def pause(self) -> None:
        """Pause the playback."""
        self._set_paused(True)

    def resume(self) -> None:
        """Continue the playback."""
        self._set_paused(False)

    def toggle_paused(self) -> None:
        """Pause or resume."""
        self._set_paused(not self.paused)

    @property
    def paused(self) -> bool:
        """Whether the playback is paused."""
        return self._clock.paused

    @property
    def rate(self) -> float:
        """Recorded seconds per second."""
        return self._clock.rate

    def set_rate(self, rate: float) -> bool:
        """Play at another rate from now on. False for one that is not a positive number."""
        if not (math.isfinite(rate) and rate > 0.0):
            return False
        with self._control():
            self._clock.change(self._reached(), rate=rate)
        return True

    def play_next(self) -> bool:
        """Publish the next message now. False if not paused or after the last message."""
        return self.burst(1) == 1

    def burst(self, count: int) -> int:
        """Publish the next `count` messages now (0: all); returns how many there were, 0 if not paused."""
        done = 0
        while (count == 0 or done < count) and self._publish_paused():
            done += 1
        return done

    def _publish_paused(self) -> bool:
        """Publish the next message; False if not paused or after the last message.

        Other controls work while subscribers are waited for: after a seek another message is the next.
        """
        while (head := self._paused_head()) is not None:
            publish = self._output.prepare(head)
            with self._control():
                if self._paused_head() is head:
                    self._send(head, publish)
                    self._clock.jump(head.log_time)
                    return True
        return False

    def _paused_head(self) -> RawMessage | None:
        with self._control():
            return self._head() if self._clock.paused else None

    def seek(self, time: int) -> None:
        """Continue from a log time, ns, no earlier than the first message. After the end, play again."""
        with self._control():
            time = max(time, self._source.start)
            if self._ahead is None:
                self._start_at = time
            else:
                self._go_to(time)

    def stop(self) -> None:
        """End this playback; play() starts a new one."""
        with self._control():
            self._stopped = True
            self._start_at = None

    def close(self) -> None:
        """Make run() return."""
        self._closed = True
        self.stop()

    def report_time(self, publish: Callable[[int], None]) -> None:
        """Call `publish` with the recorded time (ns), at most that of the next message; not before the first playback.

        No message is published meanwhile, so that all published times are in order.
        """
        with self._control():
            if (now := self._now()) is not None:
                publish(now)

    @property
    def behind(self) -> int:
        """How much the next message is overdue, ns of wall time."""
        with self._control():
            head = None if self._clock.paused else self._head()
            return 0 if head is None else max(0, -self._remaining(head))

    @property
    def _busy(self) -> bool:
        return self._ahead is not None or self._start_at is not None or self.state in ("playing", "paused")

    def _now(self) -> int | None:
        return self._time if self._head() is None else self._reached()

    def _reached(self) -> int:
        """Recorded time, at most that of the next message: an overdue one is due now, not at another rate's time."""
        head = self._head()
        return self._clock.now() if head is None else min(self._clock.now(), head.log_time)

    def _set_paused(self, paused: bool) -> None:
        with self._control():
            self._clock.change(self._reached(), paused=paused)
            self._announce()

    @contextmanager
    def _control(self) -> Iterator[None]:
        """Hold the lock. The count makes the player yield: a Python lock is not fair to waiting threads."""
        self._count_waiting(1)
        try:
            with self._changed:
                yield
                self._changed.notify_all()
        finally:
            self._count_waiting(-1)

    def _count_waiting(self, change: int) -> None:
        with self._counting:
            self._waiting += change

    def _next_position(self) -> int | None:
        """Wait for work; None after close()."""
        with self._changed:
            while self._start_at is None and not self._closed:
                self._wall.wait(self._changed, None)
            position, self._start_at, self._stopped = self._start_at, None, self._closed
            return None if self._closed else position

    def _wait_delay(self) -> bool:
        """Sleep for the delay; False if the playback was stopped."""
        begin = self._wall.now() + self._delay
        with self._changed:
            while not self._stopped and (remaining := begin - self._wall.now()) > 0:
                self._wall.wait(self._changed, remaining)
        return not self._stopped

    def _play_through(self, position: int) -> bool:
        """Play once; False if stopped or without any message."""
        before = self.published + self.failed
        with self._changed:
            self._go_to(position)
            self._announce()
        while self._step():
            while self._waiting:
                self._wall.sleep(50_000)
        return not self._stopped and self.published + self.failed > before

    def _step(self) -> bool:
        """Publish the next message, or only wait; False at the end."""
        with self._changed:
            if self._stopped or (head := self._head()) is None:
                return False
            remaining = None if self._clock.paused else self._remaining(head)
            if remaining is None or remaining > COARSE:
                self._wall.wait(self._changed, None if remaining is None else remaining - COARSE // 2)
                return True
        publish = self._output.prepare(head)
        with self._changed:
            remaining = self._remaining(head)
        if remaining > 0:
            self._wall.sleep(min(remaining, COARSE))
        with self._changed:
            # A control may have come meanwhile: another message may be the next, or this one may be due later.
            late, playing = -self._remaining(head), not (self._stopped or self._clock.paused)
            if self._head() is head and playing and late >= 0:
                self._send(head, publish)
                self.lateness.add(late)
        return True

    def _remaining(self, message: RawMessage) -> int:
        """Wall time until a message is due, ns."""
        return self._clock.deadline(message.log_time) - self._wall.now()

    def _send(self, message: RawMessage, publish: Callable[[], bool]) -> None:
        ahead, self._time = self._ahead, message.log_time
        if publish():
            self.published += 1
        else:
            self.failed += 1
        if self._ahead is ahead:  # no seek came from within the call
            self._read()

    def _head(self) -> RawMessage | None:
        last = self._range.last(self._source.start)
        return None if self._next is None or (last is not None and self._next.log_time > last) else self._next

    def _go_to(self, time: int) -> None:
        ahead = sorted_within(self._source.messages(time), self._window)
        head = next(ahead, None)  # before anything is changed: reading may fail
        self._ahead, self._next, self._time = ahead, head, time
        self._clock.jump(time)

    def _read(self) -> None:
        assert self._ahead is not None
        self._next = next(self._ahead, None)

    def _announce(self) -> None:
        if self._ahead is not None:
            self._set_state("paused" if self._clock.paused else "playing")

    def _finish(self) -> None:
        with self._changed:
            self._ahead = self._next = None
        if not self._closed:
            self._output.settle()
            with self._changed:
                self._set_state("finished")

    def _set_state(self, state: str) -> None:
        if state != self.state:
            self.state = state
            self._output.announce(state)
