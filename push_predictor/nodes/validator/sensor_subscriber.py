"""The subscriptions to tracker, robot and force sensor; their samples are taken in portions."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence
from time import monotonic

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from push_predictor.nodes.polling import PolledGroup, take_all
from push_predictor.nodes.validator.scalar_subscriber import ScalarSubscriber
from push_predictor.online.message_buffer import MessageBuffer
from push_predictor.online.stream_sync import Samples
from push_predictor.recordings.samples import PUSHER, SLIDER, WRENCH, pusher_stream, slider_stream, wrench_stream
from push_predictor.recordings.streams import ScalarStream

DEPTH = 5000  # the most that Fast DDS keeps: it rejects newer ones; memory grows as the queue fills
PERIOD = 0.01  # s between two looks into the middleware, which keeps the last DEPTH messages only
PATIENCE = 1.0  # s that a run waits for the first message of every topic
TOPICS = (
    ("slider", PoseStamped, "slider/pose", SLIDER),
    ("pusher", PoseStamped, "pusher/pose", PUSHER),
    ("wrench", WrenchStamped, "pusher/wrench", WRENCH),
)


class SensorSubscriber:
    """Subscribes to slider/pose, pusher/pose and pusher/wrench, reliable and deep unless QoS overrides change that.

    frame_id: frame that the headers must name, empty for any. scalars: the scalar topics to subscribe to as well. A
    thread empties the middleware's queues: a fast replay fills them while a portion of samples is processed.
    """

    def __init__(self, node: Node, frame_id: str, scalars: Sequence[str] = ()) -> None:
        self._node = node
        self._scalars = ScalarSubscriber(node, scalars)
        self._newest: int | None = None  # stamp (ns) of the poses
        self._buffers = {name: MessageBuffer(rules, frame_id) for name, _, _, rules in TOPICS}
        self.lost: Counter[str] = Counter()
        self._last: dict[str, int] = {}
        self._empty = monotonic()  # when nothing waited last
        group, overriding = PolledGroup(), QoSOverridingOptions.with_default_policies()
        self._subscriptions = {
            name: node.create_subscription(
                message,
                topic,
                self._buffers[name].put,  # not called: drain() takes the messages
                QoSProfile(depth=DEPTH),
                callback_group=group,
                qos_overriding_options=overriding,
                raw=True,
            )
            for name, message, topic, _ in TOPICS
        }
        self._draining, self._ending = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._drain_repeatedly, name="sensor subscriber", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._ending.set()
        self._thread.join()

    def __len__(self) -> int:
        return sum(map(len, self._buffers.values()))

    def complete(self) -> bool:
        """Whether messages of every topic wait, or messages of some topic have waited for PATIENCE.

        Call it often: it measures the time since no message waited.
        """
        waiting = [len(buffer) > 0 for buffer in self._buffers.values()]
        if not any(waiting):
            self._empty = monotonic()
        return (all(waiting) and self._scalars.waiting()) or monotonic() - self._empty > PATIENCE

    @property
    def scalar_names(self) -> list[str]:
        """The requested scalar topics, published or not, by their names in a recording."""
        return self._scalars.names

    def look(self) -> None:
        """Subscribe to scalar topics that have appeared; call often, in the executor's thread."""
        self._scalars.look()

    def drain(self) -> None:
        """Move arrived messages from the middleware into the buffers."""
        self._scalars.drain()
        with self._draining:  # one at a time, so that messages stay in order
            for name, subscription in self._subscriptions.items():
                for data, sequence, _ in take_all(subscription):
                    self._note_loss(name, subscription.topic_name, sequence)
                    self._buffers[name].put(data)

    def _note_loss(self, name: str, topic: str, sequence: int) -> None:
        """Count messages that were overwritten before they were taken: a publisher numbers its messages."""
        last, self._last[name] = self._last.get(name, sequence), sequence
        if sequence > last + 1 and self._node.count_publishers(topic) == 1:
            self.lost[name] += sequence - last - 1

    def _drain_repeatedly(self) -> None:
        while not self._ending.wait(PERIOD):
            self.drain()

    def take(self) -> Samples:
        """The usable samples since the last call."""
        self._empty = monotonic()
        slider, pusher, wrench = (self._buffers[name].take() for name, *_ in TOPICS)
        for stamp, _ in (slider, pusher):
            self._newest = int(np.median(stamp)) if len(stamp) else self._newest  # a single stamp may be wrong
        scalars = self._scalars.take(self._newest)
        return Samples(slider_stream(*slider), pusher_stream(*pusher), wrench_stream(*wrench), scalars)

    def last_scalars(self) -> dict[str, ScalarStream]:
        """The scalars since the last sample of a sensor."""
        return self._scalars.take(self._newest, last=True)

    def figures(self) -> dict[str, int]:
        """Counts of messages by topic; rejected ones also by kind, for the kinds that occurred."""
        found: dict[str, int] = {}
        for name, buffer in self._buffers.items():
            found |= {f"{name} samples": buffer.received, f"{name} rejected": buffer.rejected.total()}
            found |= {f"{name} rejected {kind}": count for kind, count in buffer.rejected.items()}
            if buffer.dropped:
                found[f"{name} dropped"] = buffer.dropped
            if self.lost[name]:
                found[f"{name} lost"] = self.lost[name]
        return found | self._scalars.figures()

    def problems(self) -> list[str]:
        """What keeps pushes from being found, in words."""
        found = []
        for name, buffer in self._buffers.items():
            topic = self._subscriptions[name].topic_name
            if not buffer.received and name != "wrench":
                found.append(f"No sample on {topic}. Its number of publishers: {self._node.count_publishers(topic)}.")
            if buffer.rejected:
                kinds = ", ".join(f"{kind} {count}" for kind, count in buffer.rejected.items())
                found.append(
                    f"{topic}: {buffer.rejected.total()} of {buffer.received} samples were rejected ({kinds})."
                )
            if lost := self.lost[name]:
                found.append(f"{topic}: {lost} samples were lost. Replay slower, or use a deeper queue (QoS).")
            if buffer.dropped:
                found.append(f"{topic}: {buffer.dropped} samples were dropped while model or rig were unknown.")
        return found + self._scalars.problems()
