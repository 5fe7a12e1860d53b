# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/pictures/replay.gif: recorded pushes, what was predicted, what happened, and an alarm.

    PYTHONPATH=. python docs/pictures/draw_replay.py

The recording is simulated. From one push on the rig differs from that of the training, as in `make demo`, and the
alarm does not know of it. The model is the one that ships with the package.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from examples.demo import SEED
from examples.hidden import PLAIN, make_hidden
from push_predictor.evaluation.alarm.scores import AlarmMonitor, calibrate
from push_predictor.evaluation.offline import recorded_windows
from push_predictor.evaluation.report.figures.ellipses import ellipse, inside
from push_predictor.evaluation.validation import Comparison, compare
from push_predictor.geometry.frames import rotate, to_world
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.resources import DEFAULT_MODEL, share_path
from push_predictor.types import Array

PICTURE = Path(__file__).with_name("replay.gif")
BEFORE, AFTER = 6, 5  # pushes shown before the change, and after the alarm
FRAMES_A_SECOND = 8
GREY, FILL, BLUE, ORANGE, RED = "#6b6b6b", "#f1f1f1", "#0072B2", "#D55E00", "#c0203a"
SCALES = (1.0, 2.0, 5.0)  # mm, of the axes of an outcome
REACH = 0.085  # m, half the width of what is seen of the table


@dataclass(frozen=True, eq=False)
class Replay:
    """Windows in order of time, their predictions, and the evidence of the alarm after each push.

    evidence, threshold: log10. fired: index of the push at which the alarm fires.
    """

    model: PushModel
    windows: list[PushWindow]
    predicted: Comparison
    pushes: list[str]
    evidence: Array
    threshold: float
    fired: int


def main() -> None:
    """Simulate, predict, and write the picture."""
    model = load_model(share_path(*DEFAULT_MODEL))
    with tempfile.TemporaryDirectory(prefix="replay_") as folder:
        replay = replayed(model, make_hidden(Path(folder), SEED).recorded)
    first, last = PLAIN - BEFORE, replay.fired + AFTER
    shown = [k for k, w in enumerate(replay.windows) if first <= replay.pushes.index(w.push_id) <= last]
    figure, axes = plt.subplots(1, 3, figsize=(9.6, 3.3), dpi=80, gridspec_kw={"width_ratios": (1.0, 1.0, 1.25)})
    figure.subplots_adjust(left=0.01, right=0.985, bottom=0.16, top=0.88, wspace=0.28)
    animation = FuncAnimation(figure, lambda k: paint(axes, replay, shown[k], first), frames=len(shown))
    animation.save(PICTURE, PillowWriter(fps=FRAMES_A_SECOND))
    print(PICTURE, f"{len(shown)} frames, {PICTURE.stat().st_size / 1e6:.2f} MB")


def replayed(model: PushModel, recording: Path) -> Replay:
    """Predict a recording window by window, and follow the alarm push by push."""
    windows, table, _ = recorded_windows(model, recording)
    predicted, monitor = compare(model, table), AlarmMonitor(calibrate(model))
    pushes, evidence, fired = list(dict.fromkeys(table.push_id.tolist())), [], None
    for k, push in enumerate(pushes):
        rows = table.push_id == push
        if monitor.add(table.take(rows), predicted.mean[rows], predicted.covariance[rows]):
            fired = k
        evidence.append(monitor.state.log10_evidence)
    if fired is None:
        raise SystemExit("The alarm does not fire on this recording: choose another seed.")
    return Replay(model, windows, predicted, pushes, np.array(evidence), monitor.state.threshold, fired)


def paint(axes: np.ndarray, replay: Replay, k: int, first: int) -> None:
    """One frame: the window k on the table, its prediction and outcome, and the evidence so far."""
    for ax in axes:
        ax.clear()
    push = replay.pushes.index(replay.windows[k].push_id)
    paint_table(axes[0], replay, k)
    paint_outcome(axes[1], replay, k)
    paint_evidence(axes[2], replay, push, first)


def paint_table(ax: Axes, replay: Replay, k: int) -> None:
    """The slider before the window, where it came to be, and the pusher."""
    window, rig = replay.windows[k], replay.model.rig
    before, after = (to_world(rig.outline.vertices, pose) for pose in (window.slider_start, window.slider_end))
    ax.add_patch(Polygon(before, fc=FILL, ec=GREY, lw=1.0))
    ax.add_patch(Polygon(after, fill=False, ec=ORANGE, lw=1.6))
    contact = np.array([window.contact])
    normal = rig.outline.inward_normal(contact)
    tip = to_world(rig.outline.point(contact) - rig.pusher_radius * normal, window.slider_start)[0]
    along = rotate(np.array([[0.03, 0.0]]), np.array([window.push_heading]))[0]
    ax.add_patch(Circle(tip, rig.pusher_radius, fc=BLUE, ec="none"))
    ax.annotate("", tip, tip - along, arrowprops={"arrowstyle": "-|>", "color": BLUE, "lw": 1.4})
    centre = window.slider_start
    ax.set(xlim=(centre[0] - REACH, centre[0] + REACH), ylim=(centre[1] - REACH, centre[1] + REACH), aspect="equal")
    ax.set_axis_off()
    ax.set_title(f"recorded push at {1e3 * window.velocity:.0f} mm/s", fontsize=10)


def paint_outcome(ax: Axes, replay: Replay, k: int) -> None:
    """The predicted 95 % ellipse and the outcome, mm in the push frame, from the predicted mean."""
    c = replay.predicted
    mean, covariance, observed = c.mean[k], c.covariance[k], c.observed[k]
    hit = bool(inside(mean, covariance, observed[None], c.tails)[0])
    around = 1e3 * ellipse(covariance[:2, :2], c.tails)
    ax.fill(*around.T, color=BLUE, alpha=0.18, lw=0)
    ax.plot(*around.T, color=BLUE, lw=1.3)
    x, y = 1e3 * (observed - mean)[:2]
    ax.plot(x, y, "o", color=ORANGE if hit else RED, ms=8 if hit else 10)
    ax.axhline(0.0, color="#e4e4e4", lw=0.8, zorder=0)
    ax.axvline(0.0, color="#e4e4e4", lw=0.8, zorder=0)
    most = 1.05 * max(np.abs(around).max(), abs(x), abs(y))
    reach = next((step for step in SCALES if step >= most), most)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    ax.set(xlabel="dx − predicted (mm)", ylabel="dy − predicted (mm)")
    ax.set_title(
        "inside the predicted 95 %" if hit else "outside the predicted 95 %", fontsize=10, color="black" if hit else RED
    )


def paint_evidence(ax: Axes, replay: Replay, push: int, first: int) -> None:
    """Evidence after each push, up to this one."""
    shown = replay.evidence[: push + 1]
    ax.axhline(10.0**replay.threshold, color=RED, lw=1.0, ls="--")
    ax.text(first + 0.3, 1.3 * 10.0**replay.threshold, "alarm", color=RED, fontsize=9)
    ax.semilogy(np.arange(len(shown)), 10.0**shown, color=RED if push >= replay.fired else GREY, lw=1.8)
    if push >= PLAIN:
        ax.axvline(PLAIN, color=GREY, lw=0.9, ls=":")
        note = "the rig changes\n(unannounced)"
        ax.text(PLAIN + 0.2, 0.97, note, color=GREY, fontsize=8, va="top", transform=ax.get_xaxis_transform())
    top = 10.0 ** (replay.evidence[: replay.fired + AFTER + 1].max() + 0.5)
    ax.set(xlim=(first, replay.fired + AFTER), ylim=(0.05, top), xlabel="push", ylabel="evidence of a change")
    title = "The model no longer fits: run trace" if push >= replay.fired else "The model fits"
    ax.set_title(title, fontsize=10, color=RED if push >= replay.fired else "black")
    ax.spines[["top", "right"]].set_visible(False)


if __name__ == "__main__":
    main()
