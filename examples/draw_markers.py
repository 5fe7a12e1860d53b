# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The markers of push_validator as a picture: recorded from a replay, drawn with matplotlib.

    python -m examples.draw_markers [PICTURE.png [MODEL]]

predict_server, push_validator and push_replay run as processes. This one subscribes to push_markers and push_residual
and draws six windows of different kinds. The picture is no screenshot of RViz.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from visualization_msgs.msg import Marker, MarkerArray

from examples.marker_canvas import draw_array
from examples.processes import LOGS, node
from push_predictor.geometry.outline import Outline
from push_predictor.nodes.qos import LATCHED
from push_predictor.recordings.load import load_rig_for
from push_predictor.reporting.canvas import draw
from push_predictor_interfaces.msg import PushResidual, ReplayStatus

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[1]
TRAINING, HELD_OUT = ROOT / "bags" / "square_abs_train", ROOT / "bags" / "square_abs_test"
PICTURE, MODEL = ROOT / "docs" / "pictures" / "markers.png", LOGS / "vhgp.pushmodel"
RATE, PATIENCE = 10.0, 300.0  # recorded seconds per second; s
QUIET = 20.0  # s without a window after the replay: the validator may be behind on a busy machine
SIDE, BELOW, ABOVE = 0.086, 0.092, 0.106  # m shown to the sides of, below and above the slider's centre
COLUMNS, WIDTH = 3, 9.0  # inches
CAPTION, FOOT = 0.25, 0.42  # inches
BACKGROUND = "#303030"  # RViz's default

FAR = 3.2  # standard deviations: outside the 95 % region, also of a distribution with tails

Kind = Callable[[PushResidual, float], bool]  # (window, place along its edge: 0 to 1)
KINDS: tuple[tuple[str, Kind], ...] = (
    ("centre of a side", lambda w, at: abs(at - 0.5) < 0.1 and abs(w.angle) < 0.2),
    ("off centre", lambda w, at: 0.2 < abs(at - 0.5) < 0.35 and abs(w.angle) < 0.3),
    ("near a corner", lambda w, at: abs(at - 0.5) > 0.42),
    ("oblique: the pusher slides", lambda w, at: abs(w.angle) > 1.0),
    ("50 mm/s", lambda w, at: w.velocity > 0.04),
    ("outside the 95 % ellipse", lambda w, at: size_of(w) > FAR),
)


class Listener:
    """The published markers and residuals, by the end time of their window."""

    def __init__(self, subscriber_node: rclpy.node.Node) -> None:
        self.markers: dict[tuple[int, int], MarkerArray] = {}
        self.residuals: dict[tuple[int, int], PushResidual] = {}
        self.finished = False
        subscriber_node.create_subscription(MarkerArray, "push_markers", self._on_markers, 1000)
        subscriber_node.create_subscription(PushResidual, "push_residual", self._on_residual, 1000)
        subscriber_node.create_subscription(ReplayStatus, "replay_status", self._on_status, LATCHED)

    def _on_markers(self, message: MarkerArray) -> None:
        self.markers[_stamp(message.markers[0])] = message

    def _on_residual(self, message: PushResidual) -> None:
        self.residuals[_stamp(message)] = message

    def _on_status(self, message: ReplayStatus) -> None:
        self.finished = message.state == ReplayStatus.FINISHED


Heard = TypeVar("Heard", bound=Listener)


def main(arguments: Sequence[str] = ()) -> int:
    """Record the markers of a replay and draw six of them."""
    parser = argparse.ArgumentParser(
        prog="python -m examples.draw_markers",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("picture", type=Path, nargs="?", default=PICTURE, help="where to write (default %(default)s)")
    parser.add_argument(
        "model", type=Path, nargs="?", default=MODEL, help="trained if it does not exist (default %(default)s)"
    )
    options = parser.parse_args(arguments)
    received = record_replay(options.model, Listener)
    chosen = choose(received, load_rig_for([HELD_OUT]).outline)
    draw_windows(options.picture, chosen)
    print(options.picture)
    return 0


def record_replay(model: Path, listen: Callable[[rclpy.node.Node], Heard]) -> Heard:
    """Replay the held-out recording for a model, which is trained if its file does not exist: all that was heard."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    LOGS.mkdir(parents=True, exist_ok=True)
    if not model.exists():
        command = ["train", str(TRAINING), "--kind", "vhgp", "--mean", "zero", "--out", str(model)]
        subprocess.run([sys.executable, "-m", "push_predictor.cli", *command], check=True)
    with _subscribed(listen) as (received, spin), ExitStack() as running:
        running.enter_context(node("predict_server", {"models": [str(model)]}))
        running.enter_context(node("push_validator", {"model": str(model)}))
        replay = {"recording": str(HELD_OUT), "play.rate": RATE, "wait_for_subscribers": 30.0}
        running.enter_context(node("push_replay", replay))
        _receive_all(received, spin)
    print(f"Received the markers of {len(received.markers)} windows.")
    return received


def choose(received: Listener, outline: Outline) -> list[tuple[str, MarkerArray]]:
    """Choose, for each kind, the window with the median error in standard deviations."""
    chosen = []
    for name, is_of_kind in KINDS:
        of_kind = [
            w for key, w in received.residuals.items() if key in received.markers and is_of_kind(w, along(outline, w))
        ]
        if not of_kind:
            raise SystemExit(f'no window of the kind "{name}"')
        window = sorted(of_kind, key=size_of)[len(of_kind) // 2]
        chosen.append((f"{name} ({len(of_kind)} windows)", received.markers[_stamp(window)]))
    return chosen


def along(outline: Outline, window: PushResidual) -> float:
    """Position of a window's contact on its edge, 0 to 1."""
    return float(outline.edge(np.array([window.contact]))[1][0])


def size_of(window: PushResidual) -> float:
    """Mahalanobis distance between outcome and prediction."""
    return float(np.linalg.norm(window.standardised))


def draw_windows(path: Path, windows: Sequence[tuple[str, MarkerArray]]) -> None:
    """Draw windows next to each other, at one scale, each around its slider."""
    rows = -(-len(windows) // COLUMNS)
    width = WIDTH / COLUMNS
    height = width * (BELOW + ABOVE) / (2.0 * SIDE)
    total = rows * (height + CAPTION) + FOOT

    def paint(figure: Figure) -> None:
        figure.set_layout_engine("none")
        for k, (name, array) in enumerate(windows):
            row, column = divmod(k, COLUMNS)
            bottom = total - (row + 1) * (height + CAPTION)
            box = (column / COLUMNS + 0.002, bottom / total, 1.0 / COLUMNS - 0.004, height / total)
            _paint(figure, box, array)
            figure.text(box[0] + 0.005, (bottom + height + 0.07) / total, name, fontsize=9.5)
        figure.text(0.005, 0.1 / total, NOTE, fontsize=8.5, color="#444444")

    draw(path, (WIDTH, total), paint)


NOTE = (
    "Messages on push_markers during a replay of bags/square_abs_test, seen from above, drawn with matplotlib.\n"
    "Grey: start; blue: predicted; orange: observed. Dot in ellipse: centre; line on dial: heading. "
    "Of each kind, the window with the median error."
)


def _paint(figure: Figure, box: tuple[float, float, float, float], array: MarkerArray) -> None:
    axes = figure.add_axes(box)
    centre = _centre(array)
    axes.set(xlim=centre[0] + np.array([-SIDE, SIDE]), ylim=centre[1] + np.array([-BELOW, ABOVE]), xticks=[], yticks=[])
    axes.set_facecolor(BACKGROUND)
    for spine in axes.spines.values():
        spine.set_visible(False)
    draw_array(axes, array)
    left, low = centre[0] - SIDE + 0.006, centre[1] - BELOW + 0.006
    axes.plot([left, left + 0.02], [low, low], color="white", linewidth=2.0, solid_capstyle="butt")
    axes.text(left + 0.023, low, "20 mm", color="white", fontsize=8.0, va="center")


def _centre(array: MarkerArray) -> np.ndarray:
    """Middle of the slider's outline before the push."""
    (start,) = (marker for marker in array.markers if marker.ns == "start_outline")
    return np.asarray(np.mean([[point.x, point.y] for point in start.points[:-1]], axis=0))


def _receive_all(received: Listener, spin: Callable[[float], None]) -> None:
    """Spin until the replay has finished and no window has arrived for QUIET seconds."""
    deadline, last, count = time.monotonic() + PATIENCE, time.monotonic(), 0
    while not received.finished or time.monotonic() - last < QUIET:
        spin(0.1)
        if len(received.markers) != count:
            last, count = time.monotonic(), len(received.markers)
        if time.monotonic() > deadline:
            raise SystemExit(f"the replay did not finish within {PATIENCE:.0f} s: see {LOGS}/*.log")


@contextmanager
def _subscribed(listen: Callable[[rclpy.node.Node], Heard]) -> Iterator[tuple[Heard, Callable[[float], None]]]:
    rclpy.init()
    subscriber_node = rclpy.create_node("draw_markers")
    executor = SingleThreadedExecutor()
    executor.add_node(subscriber_node)
    try:
        yield listen(subscriber_node), executor.spin_once
    finally:
        executor.shutdown()
        subscriber_node.destroy_node()
        rclpy.try_shutdown()


def _stamp(message: Marker | PushResidual) -> tuple[int, int]:
    return message.header.stamp.sec, message.header.stamp.nanosec


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
