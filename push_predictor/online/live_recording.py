# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A recording while it is made: the bag, what is found in its messages (samples, windows, contact), what is missing."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import replace
from pathlib import Path

import numpy as np

from push_predictor.errors import RecordingError
from push_predictor.online.recorder_progress import NANOSECOND, Pace, Progress
from push_predictor.recordings.bag.message_types import definition_text
from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.bag.metadata import TopicInfo
from push_predictor.recordings.bag.writer import BagWriter
from push_predictor.recordings.decoder.decoder import Samples, StreamDecoder, key_of
from push_predictor.recordings.decoder.sources import COVARIATE, POSES, STREAMS, sources_of, topics_to_record
from push_predictor.recordings.rig import RECORD_NAME, Rig
from push_predictor.recordings.topics import Topics, save_topics
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.push_window import PushWindow

NO_RIG = "No rig. Give --rig FILE.yaml (of the node: the parameter rig), or publish it on topic rig."
OTHER_RIG = "Topic rig now has another rig. The bag contains the first one."
EARLY = 30  # portions that wait for the rig and for the first sample of slider and pusher


class LiveRecording:
    """Writes messages into a bag and its topics next to it, and finds windows in the messages.

    path: a folder or FILE.mcap, which the first message creates or replaces; the bag grows under that name. topics:
    with full names; wanted: those to subscribe to. Times `now` are of one monotonic clock, in s. with_wrench: whether
    its absence is a problem. Raises RecordingError if path exists and is no bag.
    """

    def __init__(self, path: Path, topics: Topics, now: float, with_wrench: bool = True) -> None:
        self.topics, self.wanted = topics, topics_to_record(topics, with_wrench)
        self._writer, self._open = BagWriter(path, live=True), False
        self.path = self._writer.path
        self._declared: dict[str, tuple[TopicInfo, str]] = {}  # with the definition of the type, '' if it is unknown
        self._messages: Counter[str] = Counter()
        self._findings = Findings(topics, now)
        self._rig: Rig | None = None
        self._first: int | None = None  # log times, ns
        self._last = 0
        self._noted: dict[str, str] = {}
        self._unpublished: set[str] = set()
        self._lost: Counter[str] = Counter()

    def type_of(self, topic: str) -> str:
        """The type with which a topic is recorded, '' as long as it is unknown."""
        return self._declared[topic][0].type if topic in self._declared else ""

    def add_topic(self, topic: TopicInfo) -> None:
        """Declare the type and QoS of a topic, once."""
        try:
            schema, problem = definition_text(topic.type), ""
        except RecordingError as error:
            schema, problem = "", f"{topic.name} is recorded without the definition of its type: {error}."
        self.note(f"{topic.name} definition", problem)
        self._declared[topic.name] = topic, schema
        if self._open:
            self._declare(topic, schema)
            self._save_topics()
        self._findings.add_topic(topic.name, topic.type, schema)

    def set_rig(self, rig: Rig) -> None:
        """Record the rig, and find windows with it. The first one counts; another one becomes a problem."""
        if self._rig is None:
            self._rig = rig
            if self._open:
                self._writer.add_metadata(RECORD_NAME, rig.to_record())
            self._findings.set_rig(rig)
        elif rig is not self._rig and rig.to_record() != self._rig.to_record():
            self.note("rig", OTHER_RIG)

    def note(self, subject: str, problem: str) -> None:
        """State a problem, '' if there is none any more. subject: a topic, if the problem explains its silence."""
        self._noted.pop(subject, None)
        if problem:
            self._noted[subject] = problem

    def set_published(self, topic: str, published: bool) -> None:
        """State whether a topic has a publisher."""
        (self._unpublished.discard if published else self._unpublished.add)(topic)

    def write(self, topic: str, log_time: int, data: bytes, lost: int = 0) -> None:
        """Write a message of a declared topic. log_time in ns; lost: messages before it that did not arrive.

        Raises RecordingError that names the bag if it cannot be written.
        """
        if not self._open:
            self._begin()
        self._writer.write(topic, log_time, data)
        self._messages[topic] += 1
        self._lost[topic] += lost
        self._first = log_time if self._first is None else min(self._first, log_time)
        self._last = max(self._last, log_time)
        self._findings.put(topic, log_time, data)

    def work(self, now: float) -> None:
        """Hand what was written to the disk, and find windows. Call it once a second. Raises RecordingError."""
        if self._open:
            self._writer.flush()
        self._findings.work(now)

    def close(self, now: float) -> Progress:
        """Complete the bag; returns the summary. Raises RecordingError that names the bag if it cannot be written."""
        if self._open:
            self._open = False
            self._writer.__exit__(None, None, None)
        self._findings.work(now, last=True)
        return self.progress(now, ended=True)

    @property
    def seconds(self) -> float:
        """Time since the first message, s."""
        return 0.0 if self._first is None else (self._last - self._first) * NANOSECOND

    def progress(self, now: float, ended: bool = False) -> Progress:
        """The figures of this moment; after the end only a stream without any message is called silent."""
        found, rig = self._findings, self._rig is not None
        return Progress(
            path=str(self.path),
            seconds=self.seconds,
            messages={topic.name: self._messages[topic.name] for topic in self.wanted},
            streams=found.paces,
            windows=found.windows if rig else None,
            pushes=found.pushes,
            contact=found.contact,
            problems=self._problems(now, ended),
        )

    def _begin(self) -> None:
        self._writer.__enter__()
        self._open = True
        if self._rig is not None:
            self._writer.add_metadata(RECORD_NAME, self._rig.to_record())
        for topic, schema in self._declared.values():
            self._declare(topic, schema)
        self._save_topics()

    def _declare(self, topic: TopicInfo, schema: str) -> None:
        self._writer.add_topic(
            topic.name,
            topic.type,
            schema,
            type_hash=topic.type_hash,
            depth=topic.depth,
            durability=topic.durability,
            reliability=topic.reliability,
        )

    def _save_topics(self) -> None:
        """Save the topics of slider and pusher, and of the other streams that are in the bag."""
        topics = self.topics
        present = [s.text for name, s in sources_of(topics) if name in POSES or s.topic in self._declared]
        wrench = topics.wrench if topics.wrench in present else ""
        covariates = tuple(text for text in topics.covariates if text in present)
        try:
            save_topics(self.path, replace(topics, wrench=wrench, covariates=covariates))
        except OSError as error:
            raise RecordingError(f"{error.filename}: cannot be written ({error.strerror})") from None

    def _problems(self, now: float, ended: bool) -> dict[str, str]:
        found = {} if self._rig is not None else {"rig": NO_RIG}
        found |= self._noted | self._missing(now, ended)
        found |= {
            f"{topic} lost": f"{topic}: {lost} messages were lost before they arrived."
            for topic, lost in self._lost.items()
            if lost
        }
        return found | {f"{name} samples": text for name, text in self._findings.problems.items()}

    def _missing(self, now: float, ended: bool) -> dict[str, str]:
        """The expected topics without publisher or messages; after the end only those without any message."""
        found: dict[str, str] = {}
        for topic in self.wanted:
            name, heard = topic.name, self._messages[topic.name]
            if name in self._noted or not (topic.expected or heard) or (heard if ended else topic.static):
                continue
            if name in self._unpublished:
                found[name] = f"No publisher of {name}."
            elif ended:
                found[name] = f"No message on {name}."
            else:
                for pace in self._findings.paces:
                    if pace.topic == name and (quiet := pace.silent(now)):
                        found[f"{pace.source} silent"] = f"No message on {pace.source} for {quiet:.0f} s."
        return found


class Findings:
    """Takes messages as they are recorded.

    topics: with full names; now: the time (s) from which on messages are expected; windows: number of them so far;
    paces: of all streams, also of one without samples.
    """

    def __init__(self, topics: Topics, now: float) -> None:
        self.windows = 0
        self._decoder = StreamDecoder(topics)
        self._refused: dict[str, str] = {}
        self._types: dict[str, str] = {}
        self._waiting: dict[str, tuple[list[int], list[bytes]]] = {}
        self.paces = tuple(
            Pace(now, source.text if name == COVARIATE else name, source.text, source.topic)
            for name, source in sources_of(topics)
        )
        self._finder: WindowFinder | None = None
        self._early: deque[Samples] = deque(maxlen=EARLY)
        self._pushes: set[str] = set()

    def add_topic(self, topic: str, type_name: str, schema: str) -> None:
        """State the type of a topic; schema: its definition, '' if unknown. One that does not fit becomes a problem."""
        self._types[topic] = type_name
        for name, source in sources_of(self._decoder.topics):
            if name not in STREAMS or key_of(source.topic) != key_of(topic):
                continue
            try:
                source.check_type(type_name, "")
                if not source.frame:
                    self._decoder.inputs()[name].declare(type_name, {type_name: schema})
            except RecordingError as error:
                self._refused[name] = str(error)

    def set_rig(self, rig: Rig) -> None:
        """Find windows of this rig from now on, and in the last EARLY portions."""
        self._decoder.begin(rig)
        self._finder = WindowFinder(rig)

    def put(self, topic: str, log_time: int, data: bytes) -> None:
        """Add a message; log_time in ns."""
        times, messages = self._waiting.setdefault(topic, ([], []))
        times.append(log_time)
        messages.append(data)

    def work(self, now: float, last: bool = False) -> None:
        """Evaluate the portion of messages since the last call; last: no more will come."""
        logged = {topic: np.array(times, np.int64) for topic, (times, _) in self._waiting.items()}
        for topic, (times, data) in self._waiting.items():
            if topic in self._types:
                self._decoder.put(Messages.of(topic, self._types[topic], times, data), logged[topic])
        self._waiting = {}
        samples = self._decoder.take(last)
        stamps = {"slider": samples.slider.stamp, "pusher": samples.pusher.stamp, "wrench": samples.wrench.stamp}
        for pace in self.paces:
            of_topic = logged.get(pace.topic, np.empty(0, np.int64))
            pace.add(stamps.get(pace.name, of_topic), now)
        self._early.append(samples)
        if self._finder is not None:
            self._feed(self._finder)
            self._count(self._finder.finish() if last else self._finder.take_ready())

    @property
    def pushes(self) -> int | None:
        """Number of pushes with a window so far, None without a rig."""
        return None if self._finder is None else len(self._pushes)

    @property
    def contact(self) -> float | None:
        """Share of the slider's samples in which the tip touches it, None before the first and without a rig."""
        return None if self._finder is None else self._finder.contact_share

    @property
    def problems(self) -> dict[str, str]:
        """{stream: why it has no samples, or which samples were rejected}."""
        found = {}
        for name, source in sources_of(self._decoder.topics):
            if name not in STREAMS:
                continue
            own = self._decoder.of(name)
            if own.rejected:
                kinds = ", ".join(f"{kind} {count}" for kind, count in own.rejected.items())
                found[name] = f"{source.text}: {own.rejected.total()} samples were rejected ({kinds})."
            if problem := self._decoder.problem(name):
                found[name] = f"{source.error('', problem)}."
        return found | self._refused

    def _feed(self, finder: WindowFinder) -> None:
        """Hand the samples to the finder once slider and pusher have been seen; until then it would keep them all."""
        if not all(pace.samples for pace in self.paces if pace.name in POSES):
            return
        while self._early:
            samples = self._early.popleft()
            finder.add_wrench(samples.wrench)
            finder.add_pusher(samples.pusher)
            finder.add_slider(samples.slider)

    def _count(self, windows: list[PushWindow]) -> None:
        self.windows += len(windows)
        self._pushes.update(window.push_id for window in windows)
