# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/pictures/message.png: the way of a message, from a bag or a device to a window.

python docs/pictures/draw_message.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

PICTURE = Path(__file__).with_name("message.png")
ROS, LIBRARY, ENTRY = "#fbe6d4", "#e6eefb", "#dff0dc"
WIDTH, HEIGHT = 1.085, 0.62
# A class or function: (column, row from the top, colour, what it does)
BOXES = {
    "open_bag": (0.0, 0, ENTRY, "a bag: MCAP, sqlite,\nROS 1, CSV"),
    "FollowingSubscription": (3.0, 0, ENTRY, "a device: its topic, with\nthe publishers' type and QoS"),
    "TopicStream": (4.0, 1, ROS, "one of its topics"),
    "read_recording": (0.0, 2, LIBRARY, "check, train, validate"),
    "LiveRecording": (2.0, 2, LIBRARY, "push_recorder"),
    "SensorSubscriber": (4.0, 2, ROS, "push_validator"),
    "StreamDecoder": (2.0, 3, LIBRARY, "messages in,\nsamples out"),
    "TopicInput": (1.0, 4, LIBRARY, "messages of a stream\nuntil they are taken"),
    "TransformBuffer": (3.0, 4, LIBRARY, "/tf and /tf_static"),
    "FieldReader": (0.0, 5, LIBRARY, "numbers, stamp and frame\nin a field"),
    "PoseTopic": (1.5, 5, LIBRARY, "poses in the world"),
    "PoseFrame": (4.0, 5, LIBRARY, "poses of a frame of tf"),
    "WrenchInput": (2.75, 5, LIBRARY, "wrench along the world's\naxes, without bias"),
    "usable": (0.6, 6, LIBRARY, "rules of a sample"),
    "Samples": (2.75, 6, LIBRARY, "stamps and columns\nof each stream"),
    "Recording": (0.5, 7, LIBRARY, "the whole in memory"),
    "ValidationRun": (3.75, 7, ROS, "a run of the validator"),
    "WindowFinder": (2.0, 8, LIBRARY, "the windows in portions\nof the streams"),
    "PushWindow": (2.0, 9, LIBRARY, "one window"),
    "windows_to_table": (2.0, 10, LIBRARY, "the push table"),
}
ARROWS = (
    ("open_bag", "read_recording"),
    ("FollowingSubscription", "LiveRecording"),
    ("FollowingSubscription", "TopicStream"),
    ("TopicStream", "SensorSubscriber"),
    ("read_recording", "StreamDecoder"),
    ("LiveRecording", "StreamDecoder"),
    ("SensorSubscriber", "StreamDecoder"),
    ("StreamDecoder", "TopicInput"),
    ("StreamDecoder", "TransformBuffer"),
    ("TopicInput", "FieldReader"),
    ("TopicInput", "usable"),
    ("TopicInput", "PoseTopic"),
    ("TopicInput", "WrenchInput"),
    ("TransformBuffer", "PoseTopic"),
    ("TransformBuffer", "PoseFrame"),
    ("TransformBuffer", "WrenchInput"),
    ("PoseTopic", "Samples"),
    ("PoseFrame", "Samples"),
    ("WrenchInput", "Samples"),
    ("Samples", "Recording"),
    ("Samples", "ValidationRun"),
    ("Samples", "WindowFinder"),
    ("Recording", "WindowFinder"),
    ("ValidationRun", "WindowFinder"),
    ("WindowFinder", "PushWindow"),
    ("PushWindow", "windows_to_table"),
)


def main() -> None:
    """Draw arrows and boxes, and save them."""
    figure, axes = plt.subplots(figsize=(10.5, 11))
    axes.set(xlim=(-0.6, 4.7), ylim=(-10.5, 0.5))
    axes.axis("off")
    for one, two in ARROWS:
        (x, y, *_), (u, v, *_) = BOXES[one], BOXES[two]
        arrow = {"arrowstyle": "-|>", "color": "#444444", "lw": 1.3, "mutation_scale": 14}
        axes.annotate("", (u, -v + HEIGHT / 2), (x, -y - HEIGHT / 2 if v > y else -y), arrowprops=arrow)
    for name, (x, y, colour, text) in BOXES.items():
        draw_box(axes, name, (x, -y), colour, text)
    figure.subplots_adjust(left=0.005, right=0.995, bottom=0.005, top=0.995)
    figure.savefig(PICTURE, dpi=110)


def draw_box(axes: Axes, name: str, centre: tuple[float, float], colour: str, text: str) -> None:
    """A box with a name, and what it does, in words."""
    x, y = centre
    corner = (x - WIDTH / 2, y - HEIGHT / 2)
    axes.add_patch(
        FancyBboxPatch(corner, WIDTH, HEIGHT, boxstyle="round,pad=0,rounding_size=0.05", fc=colour, ec="#666")
    )
    axes.text(x, y + 0.16, name, ha="center", va="center", weight="bold", size=9.5)
    axes.text(x, y - 0.13, text, ha="center", va="center", size=8)


if __name__ == "__main__":
    main()
