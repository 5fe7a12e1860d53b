# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The lateness that a replay can hardly undercut on this machine: that of a bare loop over the same deadlines.

    python -m benchmarks.nodes.bare_loop sleep|publish BAG --rate R --seconds S

Prints JSON: p50, p99 and maximum in us, `late` up to the call that publishes the message and `late_after` up to its
return. `sleep` only sleeps until each deadline, `publish` then publishes the message. Both read the messages into
memory first, and sleep like push_replay: absolute deadlines, timer slack 1 ns.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from time import perf_counter_ns, sleep

from push_predictor.recordings.bag.messages import RawMessage
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.replay.player import SECOND
from push_predictor.replay.report import Delays, Lateness

PUSH_TOPICS = ("/slider/pose", "/pusher/pose", "/pusher/wrench")


def main() -> int:
    """Run the loop and print the figures; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=("sleep", "publish"))
    parser.add_argument("bag", type=Path)
    parser.add_argument("--rate", type=float, default=1.0)
    parser.add_argument("--seconds", type=float, default=60.0, help="of recorded time")
    options = parser.parse_args()
    every = sorted(open_bag(options.bag).messages(), key=lambda message: message.log_time)
    end = every[0].log_time + options.seconds * SECOND
    messages = [message for message in every if message.log_time <= end]
    publish = _publisher(messages) if options.kind == "publish" else lambda message: None
    print(json.dumps({"late": asdict(lateness(messages, options.rate, publish))}))
    return 0


def lateness(messages: list[RawMessage], rate: float, publish: Callable[[RawMessage], object]) -> Delays:
    """Sleep until the time of each message and publish it; returns the delays up to then."""
    late, first = Lateness(), messages[0].log_time
    begin = perf_counter_ns() + SECOND // 100  # the first deadline is not late
    for message in messages:
        deadline = begin + round((message.log_time - first) / rate)
        if (remaining := deadline - perf_counter_ns()) > 0:
            sleep(remaining / SECOND)
        now = perf_counter_ns()
        publish(message)
        late.add(now - deadline)
    return late.delays()


def _publisher(messages: list[RawMessage]) -> Callable[[RawMessage], object]:
    """A function that publishes a message, once each push topic has a subscriber."""
    import rclpy

    from push_predictor.nodes.qos import message_class

    rclpy.init()
    node = rclpy.create_node("bare_loop")
    topics = {message.topic: message_class(message.type) for message in messages}
    publishers = {topic: node.create_publisher(kind, topic, 1000) for topic, kind in topics.items()}
    while not all(publishers[topic].get_subscription_count() for topic in PUSH_TOPICS):
        sleep(0.01)
    return lambda message: publishers[message.topic].publish(message.data)


if __name__ == "__main__":
    sys.exit(main())
