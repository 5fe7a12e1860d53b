# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/pictures/rig.png: what a rig file and the poses of a recording mean, from above and from the side.

    python docs/pictures/draw_rig.py

All lengths are in m.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon, Rectangle

from push_predictor.geometry.frames import rotate, to_world
from push_predictor.geometry.shapes import shape_outline

PICTURE = Path(__file__).with_name("rig.png")
OUTLINE = shape_outline("rect1")
SIDE, HEIGHT, RADIUS = 0.09, 0.013, 0.00475
POSE = np.array([0.115, 0.088, 0.35])
LIFT = 0.02  # above the slider's frame: a tip above it is lifted
GREY, FILL, BLUE, RED, GREEN, ORANGE = "#6b6b6b", "#e6eefb", "#1f5fb4", "#c0203a", "#1a8a5a", "#d1570a"


def main() -> None:
    """Draw both views next to each other and save them."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(13.0, 6.2), gridspec_kw={"width_ratios": [0.225, 0.205]})
    draw_from_above(left)
    draw_from_the_side(right)
    figure.subplots_adjust(left=0.005, right=0.995, bottom=0.01, top=0.93, wspace=0.02)
    figure.savefig(PICTURE, dpi=130)


def draw_from_above(axes: Axes) -> None:
    """World frame, slider with its frame, first vertex, sizes, and the tip in contact."""
    prepare(axes, "From above: the world frame and the slider's frame", (-0.012, 0.213), (-0.022, 0.168))
    corners = to_world(OUTLINE.vertices, POSE)
    axes.add_patch(Polygon(corners, fc=FILL, ec=BLUE, lw=2))
    frame(axes, np.zeros(2), 0.0, 0.036, "black")
    axes.text(0.006, -0.010, "world: the same for both poses; z points to you", va="center")
    frame(axes, POSE[:2], POSE[2], 0.036, BLUE)
    axes.text(*(POSE[:2] + [-0.002, -0.008]), "origin: centroid", color=BLUE, ha="center", va="center")
    turn = np.linspace(0.0, POSE[2], 30)
    axes.plot(POSE[0] + 0.052 * np.cos(turn), POSE[1] + 0.052 * np.sin(turn), color=RED, lw=2)
    axes.plot(POSE[0] + np.array([0.0, 0.066]), POSE[[1, 1]], "--", color=GREY, lw=1.2)
    axes.text(0.172, 0.0985, "heading:\ncounter-\nclockwise", color=RED, va="center", size=11)
    axes.plot(*corners[0], "o", mfc="white", mec=GREEN, ms=9, mew=2, zorder=5)
    axes.text(*(corners[0] + [0.0, 0.006]), "first vertex:\ncontact 0", color=GREEN, ha="right", va="bottom")
    side = to_world(np.array([[-0.045, -0.056], [0.045, -0.056]]), POSE)
    dimension(axes, side[0], side[1], "side 90.0 mm", (0.0, -0.004))
    tip = to_world(np.array([[-0.045 - RADIUS, 0.012]]), POSE)[0]
    axes.add_patch(Circle(tip, RADIUS, fc="#444444", ec="black", zorder=4))
    axes.plot(*tip, "+", color="white", ms=6, zorder=5)
    axes.annotate(
        "pusher's tip:\nits centre is the pose,\nradius 4.75 mm", tip, (-0.010, 0.057), ha="left", arrowprops=LEADER
    )


def draw_from_the_side(axes: Axes) -> None:
    """Table, slider, tip in contact and lifted."""
    prepare(axes, "From the side: the tip's height", (-0.030, 0.175), (-0.075, 0.098))
    axes.add_patch(Rectangle((-0.030, -0.012), 0.205, 0.012, fc="#eeeeee", ec="none"))
    axes.plot([-0.030, 0.175], [0.0, 0.0], color=GREY, lw=1.5)
    axes.text(0.172, -0.006, "surface: its name", color=GREY, ha="right", va="center")
    axes.add_patch(Rectangle((0.060, 0.0), SIDE, HEIGHT, fc=FILL, ec=BLUE, lw=2))
    axes.text(0.105, 0.0015, "slider: its mass in kg", color=BLUE, ha="center", va="bottom", size=11)
    arrow(axes, np.array([0.105, HEIGHT]), np.array([0.105, HEIGHT + 0.028]), BLUE)
    axes.text(0.109, HEIGHT + 0.026, "z up", color=BLUE, va="center")
    tip(axes, 0.060 - RADIUS, 0.004, "#444444")
    axes.text(0.046, 0.023, "in contact", ha="right", va="center")
    tip(axes, 0.010, HEIGHT + LIFT + 0.008, "#b5b5b5")
    axes.text(0.018, 0.066, "lifted: over 20 mm\nabove the slider's frame", va="center")
    axes.plot([-0.012, 0.060], [HEIGHT, HEIGHT], ":", color=GREY, lw=1.2)
    axes.plot([-0.012, 0.030], [HEIGHT + LIFT] * 2, ":", color=GREY, lw=1.2)
    dimension(axes, np.array([-0.010, HEIGHT]), np.array([-0.010, HEIGHT + LIFT]), "20 mm", (-0.003, 0.0), "right")
    lines = (
        "Give all lengths in metres, angles in radians, stamps of one clock.",
        "Measure the outline where the tip touches it.",
        "The wrench is the force of the slider on the tip.",
    )
    for row, line in enumerate(lines):
        axes.text(-0.028, -0.030 - 0.013 * row, f"•  {line}", va="center")


def tip(axes: Axes, x: float, z: float, colour: str) -> None:
    """The rod of the pusher; z: height of its lower end."""
    axes.add_patch(Rectangle((x - RADIUS, z), 2.0 * RADIUS, 0.040, fc=colour, ec="black", lw=1.2, zorder=4))


def frame(axes: Axes, origin: np.ndarray, turn: float, length: float, colour: str) -> None:
    """Axes x and y of a frame."""
    for axis, name in ((np.array([1.0, 0.0]), "x"), (np.array([0.0, 1.0]), "y")):
        end = origin + rotate(length * axis, np.array(turn))
        arrow(axes, origin, end, colour)
        axes.text(*(end + rotate(0.005 * axis, np.array(turn))), name, color=colour, ha="center", va="center", size=14)
    axes.plot(*origin, "o", color=colour, ms=6, zorder=6)


def dimension(
    axes: Axes, start: np.ndarray, end: np.ndarray, text: str, offset: tuple[float, float], side: str = "center"
) -> None:
    """A line with two heads and a length."""
    style = {"arrowstyle": "<|-|>", "color": ORANGE, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, start, arrowprops=style)
    turn = np.degrees(np.arctan2(*(end - start)[::-1])) if side == "center" else 0.0
    place = 0.5 * (start + end) + offset
    vertical = "top" if side == "center" else "center"
    axes.text(*place, text, color=ORANGE, ha=side, va=vertical, rotation=turn, rotation_mode="anchor")


def prepare(axes: Axes, title: str, x: tuple[float, float], y: tuple[float, float]) -> None:
    """Equal scales, no frame, the title in bold."""
    axes.set(xlim=x, ylim=y, aspect="equal")
    axes.axis("off")
    axes.set_title(title, weight="bold", size=14)


def arrow(axes: Axes, start: np.ndarray, end: np.ndarray, colour: str) -> None:
    """A straight arrow from start to end."""
    style = {"arrowstyle": "-|>", "color": colour, "lw": 2.2, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 16}
    axes.annotate("", end, start, arrowprops=style, zorder=5)


LEADER = {"arrowstyle": "-", "color": "black", "lw": 1.0}

if __name__ == "__main__":
    plt.rcParams.update({"font.size": 12})
    main()
