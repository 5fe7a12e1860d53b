"""What the tracker, the robot and the force sensor publish, taken in portions."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from time import monotonic

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from msg_adapters.streams import MessageBuffer
from push_predictor.nodes.polling import PolledGroup, take_all
from push_predictor.nodes.validator.scalar_subscriber import ScalarSubscriber
from push_predictor.recordings.samples import PUSHER, SLIDER, WRENCH, pusher_stream, slider_stream, wrench_stream
from push_predictor.recordings.streams import PoseStream, ScalarStream, WrenchStream

DEPTH = 5000  # the most that Fast DDS keeps, of more the newest are turned away; memory is taken as they fill
PERIOD = 0.01  # s between two looks into the middleware, which keeps the last DEPTH messages only
PATIENCE = 1.0  # s
TOPICS = (
    ("slider", PoseStamped, "slider/pose", SLIDER),
    ("pusher", PoseStamped, "pusher/pose", PUSHER),
    ("wrench", WrenchStamped, "pusher/wrench", WRENCH),
)


@dataclass(frozen=True, eq=False)
class Samples:
    """A portion of each stream; scalars: of each scalar topic that is or was there, by its name in a recording."""

    slider: PoseStream
    pusher: PoseStream
    wrench: WrenchStream
    scalars: Mapping[str, ScalarStream] = field(default_factory=dict)

    def __len__(self) -> int:
        """How many samples of the sensors."""
        return len(self.slider) + len(self.pusher) + len(self.wrench)


class SensorSubscriber:
    """Subscribes to slider/pose, pusher/pose and pusher/wrench, reliable and deep unless QoS overrides say otherwise.

    frame_id: what the headers must name, empty for any. scalars: the scalar topics beside them. A thread empties the
    middleware's queues: a fast replay fills them within the time that a portion of samples takes to be judged.
    """

    def __init__(self, node: Node, frame_id: str, scalars: Sequence[str] = ()) -> None:
        self._node = node
        self._scalars = ScalarSubscriber(node, scalars)
        self._newest: int | None = None  # stamp (ns) of the poses
        self._inboxes = {name: MessageBuffer(kind, frame_id) for name, _, _, kind in TOPICS}
        self.lost: Counter[str] = Counter()
        self._last: dict[str, int] = {}
        self._empty = monotonic()  # when nothing waited
        group, overriding = PolledGroup(), QoSOverridingOptions.with_default_policies()
        self._subscriptions = {
            name: node.create_subscription(
                message,
                topic,
                self._inboxes[name].put,  # not called: drain() takes the messages
                QoSProfile(depth=DEPTH),
                callback_group=group,
                qos_overriding_options=overriding,
                raw=True,
            )
            for name, message, topic, _ in TOPICS
        }
        self._draining, self._ending = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._keep_draining, name="sensor inlet", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._ending.set()
        self._thread.join()

    def __len__(self) -> int:
        return sum(map(len, self._inboxes.values()))

    def complete(self) -> bool:
        """Has every topic sent something that waits, or one of them nothing for a second after the sensors?

        To be asked often, for it takes the time since nothing waited.
        """
        waiting = [len(inbox) > 0 for inbox in self._inboxes.values()]
        if not any(waiting):
            self._empty = monotonic()
        return (all(waiting) and self._scalars.waiting()) or monotonic() - self._empty > PATIENCE

    @property
    def scalar_names(self) -> list[str]:
        """The scalar topics that were asked for, there or not, by their names in a recording."""
        return self._scalars.names

    def look(self) -> None:
        """Subscribe to scalar topics that have appeared; for the executor's thread, often."""
        self._scalars.look()

    def drain(self) -> None:
        """Bring in what has arrived by now."""
        self._scalars.drain()
        with self._draining:  # one at a time, so that messages stay in order
            for name, subscription in self._subscriptions.items():
                for data, sequence, _ in take_all(subscription):
                    self._note_loss(name, subscription.topic_name, sequence)
                    self._inboxes[name].put(data)

    def _note_loss(self, name: str, topic: str, sequence: int) -> None:
        """A publisher counts its messages; what is left out was overwritten before it was taken."""
        last, self._last[name] = self._last.get(name, sequence), sequence
        if sequence > last + 1 and self._node.count_publishers(topic) == 1:
            self.lost[name] += sequence - last - 1

    def _keep_draining(self) -> None:
        while not self._ending.wait(PERIOD):
            self.drain()

    def take(self) -> Samples:
        """The usable samples since the last call."""
        slider, tip, wrench = (self._inboxes[name].take() for name, *_ in TOPICS)
        for stamp, _ in (slider, tip):
            self._newest = int(np.median(stamp)) if len(stamp) else self._newest  # one stamp may be of another time
        scalars = self._scalars.take(self._newest)
        return Samples(slider_stream(*slider), pusher_stream(*tip), wrench_stream(*wrench), scalars)

    def last_scalars(self) -> dict[str, ScalarStream]:
        """The scalars that no sensor's sample came after."""
        return self._scalars.take(self._newest, last=True)

    def figures(self) -> dict[str, int]:
        """Counts by topic; rejected also by kind, for the kinds that occurred."""
        found: dict[str, int] = {}
        for name, inbox in self._inboxes.items():
            found |= {f"{name} samples": inbox.received, f"{name} rejected": inbox.rejected.total()}
            found |= {f"{name} rejected {kind}": count for kind, count in inbox.rejected.items()}
            if inbox.dropped:
                found[f"{name} dropped"] = inbox.dropped
            if self.lost[name]:
                found[f"{name} lost"] = self.lost[name]
        return found | self._scalars.figures()

    def problems(self) -> list[str]:
        """What keeps pushes from being found, in words."""
        found = []
        for name, inbox in self._inboxes.items():
            topic = self._subscriptions[name].topic_name
            if not inbox.received and name != "wrench":
                found.append(f"no sample on {topic}, which {self._node.count_publishers(topic)} nodes publish")
            if inbox.rejected:
                kinds = ", ".join(f"{kind} {count}" for kind, count in inbox.rejected.items())
                found.append(f"{topic}: {inbox.rejected.total()} of {inbox.received} samples rejected ({kinds})")
            if lost := self.lost[name]:
                found.append(f"{topic}: {lost} samples lost, this machine is too busy: replay slower, or a deeper QoS")
            if inbox.dropped:
                found.append(f"{topic}: {inbox.dropped} samples dropped while model or rig were unknown")
        return found + self._scalars.problems()
