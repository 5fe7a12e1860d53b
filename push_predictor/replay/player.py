"""Plays a source: peek, sleep until its time, publish, pop. Every control is one public method. No ROS here."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from push_predictor.recordings.bag.reader import RawMessage
from push_predictor.replay.clock import PlayerClock, Wall
from push_predictor.replay.lateness import Lateness
from push_predictor.replay.range import PlayRange
from push_predictor.replay.source import ReadAhead, Source

_READING = 300_000  # ns: with less time than this before the next deadline nothing is read ahead


@dataclass(frozen=True)
class Outlet:
    """Where a player speaks.

    make_room: waits until subscribers have what a message would overwrite, while controls go on; publish: sends it,
    False if that failed; settle: waits until subscribers have what was sent; announce: is told playing, paused or
    finished.
    """

    make_room: Callable[[RawMessage], None]
    publish: Callable[[RawMessage], bool]
    settle: Callable[[], None]
    announce: Callable[[str], None]


class ReplayPlayer:
    """A player over a source and a clock; run() is a thread's work, all else may be called from others.

    Messages are never dropped: one that is late goes out at once. published and failed count messages.
    """

    def __init__(
        self, source: Source, clock: PlayerClock, wall: Wall, outlet: Outlet, window: int, loop: bool, delay: int
    ) -> None:
        self._source, self._clock, self._wall, self._outlet = source, clock, wall, outlet
        self._size, self._loop, self._delay = window, loop, delay
        self._changed = threading.Condition()
        self._waiting, self._counting = 0, threading.Lock()
        self._ahead: ReadAhead | None = None
        self._range = PlayRange()
        self._todo: int | None = None
        self._stopped = self._closed = False
        self._time: int | None = None
        self.state = "waiting"
        self.lateness = Lateness()
        self.published = self.failed = 0

    def run(self) -> None:
        """Play whenever play() or seek() asks, until close()."""
        while (position := self._next_position()) is not None:
            while self._wait_delay() and self._play_through(position) and self._loop:
                position = self._range.first(self._source.start)
            self._finish()

    def play(self, what: PlayRange) -> bool:
        """Play from the range's start. False while playing."""
        with self._control():
            if self._busy:
                return False
            self._range = what
            self._todo = what.first(self._source.start)
        return True

    def pause(self) -> None:
        """Stand still."""
        with self._control():
            self._clock.pause()
            self._announce()

    def resume(self) -> None:
        """Go on."""
        with self._control():
            self._clock.resume()
            self._announce()

    def toggle_paused(self) -> None:
        """Pause or resume."""
        (self.resume if self._clock.paused else self.pause)()

    @property
    def paused(self) -> bool:
        """Does it stand still?"""
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
        """Publish the next message now. False if not paused, or after the last."""
        return self.burst(1) == 1

    def burst(self, count: int) -> int:
        """Publish the next `count` messages now (0: all); answers how many that were, 0 if not paused."""
        done = 0
        with self._control():
            while self._clock.paused and (count == 0 or done < count) and (head := self._head()) is not None:
                self._outlet.make_room(head)
                self._send(head)
                done += 1
            if done and self._time is not None:
                self._clock.jump(self._time)
        return done

    def seek(self, time: int) -> None:
        """Go on from a log time, ns; before the first message means its start. After the end it plays again."""
        with self._control():
            time = max(time, self._source.start)
            if self._ahead is None:
                self._todo = time
            else:
                self._go_to(time)

    def stop(self) -> None:
        """End this playback; play() begins a new one."""
        with self._control():
            self._stopped = True
            self._todo = None
            self._clock.interrupt()

    def close(self) -> None:
        """Make run() return."""
        self._closed = True
        self.stop()

    def tell_time(self, tell: Callable[[int], None]) -> None:
        """Tell the recorded time (ns), never beyond a message that is still to come; nothing before the first playback.

        No message goes out meanwhile, so that the times told are in order with those of messages.
        """
        with self._control():
            if (now := self._now()) is not None:
                tell(now)

    @property
    def behind(self) -> int:
        """By how much the next message is overdue, ns of wall time."""
        with self._control():
            head = None if self._clock.paused else self._head()
            return 0 if head is None else max(0, self._wall.now() - self._clock.deadline(head.log_time))

    @property
    def _busy(self) -> bool:
        return self._ahead is not None or self._todo is not None or self.state in ("playing", "paused")

    def _now(self) -> int | None:
        if self._ahead is not None and (head := self._head()) is not None:
            return min(self._clock.now(), head.log_time)
        return self._time

    @contextmanager
    def _control(self) -> Iterator[None]:
        """Hold the lock. The count makes the player step aside: a Python lock is not fair to those who wait."""
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
            while self._todo is None and not self._closed:
                self._wall.wait(self._changed, None)
            position, self._todo, self._stopped = self._todo, None, self._closed
            return None if self._closed else position

    def _wait_delay(self) -> bool:
        """Sleep the delay; False if told to stop."""
        begin = self._wall.now() + self._delay
        with self._changed:
            while not self._stopped and (left := begin - self._wall.now()) > 0:
                self._wall.wait(self._changed, left)
        return not self._stopped

    def _play_through(self, position: int) -> bool:
        """One pass; False if it was stopped or held no message."""
        before = self.published + self.failed
        with self._changed:
            self._go_to(position)
            self._announce()
        while self._step():
            while self._waiting:
                self._wall.sleep(50_000)
        return not self._stopped and self.published + self.failed > before

    def _step(self) -> bool:
        """One message, or one look; False at the end."""
        generation = self._clock.generation
        with self._changed:
            if self._stopped or (head := self._head()) is None:
                return False
            deadline = self._clock.deadline(head.log_time)
            assert self._ahead is not None
            self._ahead.fill(lambda: deadline - self._wall.now() > _READING)
        if self._clock.sleep_until(head.log_time, generation):
            self._outlet.make_room(head)
            self._send_at(head, generation)
        return True

    def _send_at(self, head: RawMessage, generation: int) -> None:
        with self._changed:
            # A control may have come between the sleep and the lock; then the head may be another one.
            if generation == self._clock.generation and not self._stopped:
                deadline = self._clock.deadline(head.log_time)
                self._send(head)
                self.lateness.add(self._wall.now() - deadline)

    def _send(self, message: RawMessage) -> None:
        assert self._ahead is not None
        self._ahead.pop()
        self._time = message.log_time
        if self._outlet.publish(message):
            self.published += 1
        else:
            self.failed += 1

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
            self._tell("paused" if self._clock.paused else "playing")

    def _finish(self) -> None:
        with self._changed:
            self._ahead = None
        if not self._closed:
            self._outlet.settle()
            with self._changed:
                self._tell("finished")

    def _tell(self, state: str) -> None:
        if state != self.state:
            self.state = state
            self._outlet.announce(state)
