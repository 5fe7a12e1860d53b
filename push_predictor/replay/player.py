# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The player of a replay: peek, sleep until the message's time, publish, pop. Every control is a public method."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from push_predictor.recordings.bag.reader import RawMessage
from push_predictor.replay.clock import PlayerClock, SystemClock
from push_predictor.replay.report import Lateness
from push_predictor.replay.source import BagSource, ReadAhead

_READING = 300_000  # ns: nothing is read ahead in less time than this before a deadline


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

    Messages are never dropped: a late one is published at once. published and failed count messages. lateness: delay
    up to the call that publishes a message.
    """

    def __init__(
        self,
        source: BagSource,
        clock: PlayerClock,
        wall: SystemClock,
        output: PlayerOutput,
        window: int,
        loop: bool,
        delay: int,
    ) -> None:
        self._source, self._clock, self._wall, self._output = source, clock, wall, output
        self._size, self._loop, self._delay = window, loop, delay
        self._lock = threading.RLock()
        self._changed = threading.Condition(self._lock)
        self._waiting, self._counting = 0, threading.Lock()
        self._ahead: ReadAhead | None = None
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
        with self._control():
            self._clock.pause()
            self._announce()

    def resume(self) -> None:
        """Continue the playback."""
        with self._control():
            self._clock.resume()
            self._announce()

    def toggle_paused(self) -> None:
        """Pause or resume."""
        (self.resume if self._clock.paused else self.pause)()

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
            self._clock.set_rate(rate)
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
            self._clock.interrupt()

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
            return 0 if head is None else max(0, self._wall.now() - self._clock.deadline(head.log_time))

    @property
    def _busy(self) -> bool:
        return self._ahead is not None or self._start_at is not None or self.state in ("playing", "paused")

    def _now(self) -> int | None:
        if self._ahead is not None and (head := self._head()) is not None:
            return min(self._clock.now(), head.log_time)
        return self._time

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
        """Publish the next message, or only sleep; False at the end."""
        generation = self._clock.generation
        with self._changed:
            if self._stopped or (head := self._head()) is None:
                return False
            deadline = self._clock.deadline(head.log_time)
            assert self._ahead is not None
            self._ahead.fill(lambda: deadline - self._wall.now() > _READING)
        publish = self._output.prepare(head)
        if self._clock.sleep_until(head.log_time, generation):
            self._send_at(head, publish, generation, deadline)
        return True

    def _send_at(self, head: RawMessage, publish: Callable[[], bool], generation: int, deadline: int) -> None:
        with self._lock:
            # A control may have come between the sleep and the lock: the head may have changed.
            if generation == self._clock.generation and not self._stopped:
                begin = self._wall.now()
                self._send(head, publish)
                self.lateness.add(begin - deadline)

    def _send(self, message: RawMessage, publish: Callable[[], bool]) -> None:
        ahead, self._time = self._ahead, message.log_time
        if publish():
            self.published += 1
        else:
            self.failed += 1
        assert ahead is not None
        ahead.pop()

    def _head(self) -> RawMessage | None:
        head = self._ahead.peek() if self._ahead else None
        last = self._range.last(self._source.start)
        return None if head is None or (last is not None and head.log_time > last) else head

    def _go_to(self, time: int) -> None:
        self._ahead = ReadAhead(self._source.messages(time), self._size)
        self._time = time
        self._clock.jump(time)

    def _announce(self) -> None:
        if self._ahead is not None:
            self._set_state("paused" if self._clock.paused else "playing")

    def _finish(self) -> None:
        with self._changed:
            self._ahead = None
        if not self._closed:
            self._output.settle()
            with self._changed:
                self._set_state("finished")

    def _set_state(self, state: str) -> None:
        if state != self.state:
            self.state = state
            self._output.announce(state)
