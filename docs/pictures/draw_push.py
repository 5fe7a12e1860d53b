# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/pictures/push.png: the inputs and the outcome of one push.

    python docs/pictures/draw_push.py

The motion is that of the analytical model, 4 s at 20 mm/s, so that it is large enough to see. All lengths are in m.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Arc, Circle, Polygon

from push_predictor.geometry.frames import rotate
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.mechanics.fitted import analytical_mechanics

PICTURE = Path(__file__).with_name("push.png")
OUTLINE = shape_outline("rect1")
RADIUS = 0.00475
VELOCITY, CONTACT, ANGLE, DURATION = 0.02, 0.22, 0.35, 4.0
FRICTION = 0.6
GREY, FILL, GREEN, ORANGE = "#6b6b6b", "#f1f1f1", "#1a8a5a", "#d1570a"
BLUE, PURPLE, RED = "#1f5fb4", "#7a3fa0", "#c0203a"


def main() -> None:
    """Draw both halves next to each other and save them."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(13.0, 5.6), gridspec_kw={"width_ratios": [0.180, 0.236]})
    draw_inputs(left)
    draw_outcome(right)
    figure.subplots_adjust(left=0.005, right=0.995, bottom=0.01, top=0.92, wspace=0.0)
    figure.savefig(PICTURE, dpi=130)


def contact_point() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Contact point, inward normal and direction of the push, (2,) each, in the slider's body frame."""
    contact = np.array([CONTACT])
    normal = OUTLINE.inward_normal(contact)
    return OUTLINE.point(contact)[0], normal[0], rotate(normal, np.array([ANGLE]))[0]


def draw_inputs(axes: Axes) -> None:
    """The push: outline, contact, inward normal, angle, velocity."""
    point, normal, direction = contact_point()
    tip = point - RADIUS * normal
    first = OUTLINE.vertices[0]
    prepare(axes, "Inputs: how the slider is pushed", (-0.122, 0.058), (-0.082, 0.093))
    axes.add_patch(Polygon(OUTLINE.vertices, fc=FILL, ec=GREY, lw=1.8))
    axes.plot(0, 0, "+", color=GREY, ms=11, mew=1.6)
    axes.text(0.003, 0.003, "slider's centre", color=GREY)
    axes.plot(*first, "o", mfc="white", mec=GREEN, ms=8, mew=2, zorder=5)
    axes.text(first[0], first[1] + 0.005, "first vertex: contact = 0", color=GREEN, ha="center", va="bottom")
    arrow(axes, first, point, GREEN, width=3.4)
    axes.text(-0.05, 0.008, "contact = 0.22\n(share of the perimeter,\ncounter-clockwise)", color=GREEN, ha="right")
    axes.plot(*(tip + np.outer([-0.0, 0.080], normal)).T, "--", color=GREY, lw=1.4)
    axes.text(0.0425, tip[1] - 0.002, "inward normal", color=GREY, ha="right", va="top")
    axes.add_patch(Circle(tip, RADIUS, fc="#444444", ec="black", zorder=4))
    axes.text(tip[0] - 0.007, tip[1], "pusher", ha="right", va="center")
    arrow(axes, tip, tip + 0.068 * direction, ORANGE, width=2.6)
    axes.text(*(tip + 0.070 * direction + [-0.02, 0.003]), "velocity", color=ORANGE, ha="center")
    angle_arc(axes, tip, 0.045, 0.0, ANGLE, RED)
    axes.text(tip[0] + 0.047, tip[1] + 0.0065, "angle", color=RED, va="center")
    axes.plot(*point, "o", color=GREEN, ms=7, zorder=6)
    axes.annotate(
        "contact point", point, (-0.062, -0.049), color=GREEN, ha="right", va="center", arrowprops=leader(GREEN)
    )
    axes.text(0.045, -0.056, "angles: counter-clockwise is positive", color=GREY, ha="right")


def draw_outcome(axes: Axes) -> None:
    """The outcome: slider and pusher before and after, push frame, dx, dy, dtheta."""
    point, normal, direction = contact_point()
    dx, dy, dtheta = analytical_mechanics(OUTLINE, RADIUS, FRICTION).displacement(
        np.array([[VELOCITY, CONTACT, ANGLE]]), np.array([DURATION])
    )[0]
    left = np.array([-direction[1], direction[0]])
    along, centre = dx * direction, dx * direction + dy * left
    tip = point - RADIUS * normal
    end = tip + VELOCITY * DURATION * direction
    prepare(axes, "Outcome: how the slider moves in the push frame", (-0.098, 0.138), (-0.066, 0.109))
    axes.add_patch(Polygon(OUTLINE.vertices, fc="none", ec=GREY, lw=1.6, ls="--"))
    axes.add_patch(
        Polygon(centre + rotate(OUTLINE.vertices, np.full(4, dtheta)), fc="#e6eefb", ec=BLUE, lw=2, zorder=0)
    )
    axes.text(-0.043, 0.047, "slider before", color=GREY, va="bottom")
    axes.text(0.042, 0.0885, "slider after", color=BLUE, ha="right")
    axes.add_patch(Circle(tip, RADIUS, fc="white", ec="black", lw=1.4, ls="--", zorder=4))
    axes.add_patch(Circle(end, RADIUS, fc="#444444", ec="black", zorder=4))
    arrow(axes, tip + RADIUS * direction, end - RADIUS * direction, ORANGE, width=1.8)
    axes.text(tip[0] - 0.007, tip[1], "pusher\nbefore", ha="right", va="center")
    axes.annotate("pusher after", end, end + [0.030, -0.020], va="center", arrowprops=leader("black"))
    middle = 0.5 * (tip + end) - 0.0035 * left
    style = {"rotation": np.degrees(ANGLE), "rotation_mode": "anchor", "ha": "center", "va": "top"}
    axes.text(*middle, "velocity × duration", color=ORANGE, **style)
    push_frame(axes, direction, left)
    arrow(axes, np.zeros(2), along, BLUE, width=3.2)
    arrow(axes, along, centre, PURPLE, width=3.2)
    axes.text(*(0.42 * along + [0.003, -0.0035]), "dx", color=BLUE, va="top", size=15)
    axes.text(*(along + 0.5 * (centre - along) + [0.003, 0.001]), "dy", color=PURPLE, size=15)
    axes.plot(0, 0, "o", color=GREY, ms=6, zorder=6)
    axes.plot(*centre, "o", color=BLUE, ms=6, zorder=6)
    heading(axes, centre, dtheta)


def push_frame(axes: Axes, direction: np.ndarray, left: np.ndarray) -> None:
    """The axes of the push frame at the slider's centre before the push."""
    for axis, length, name in ((direction, 0.098, "x"), (left, 0.035, "y")):
        arrow(axes, np.zeros(2), length * axis, "black", width=1.1)
        axes.text(*((length + 0.005) * axis), name, ha="center", va="center", size=14)
    axes.text(0.138, -0.058, "push frame: x along the push, y to its left", ha="right")


def heading(axes: Axes, centre: np.ndarray, dtheta: float) -> None:
    """The slider's heading before (dashed) and after (solid), and the turn between them."""
    after = np.array([np.cos(dtheta), np.sin(dtheta)])
    axes.plot(*(centre + np.outer([0.0, 0.063], [1.0, 0.0])).T, "--", color=GREY, lw=1.4)
    axes.plot(*(centre + np.outer([0.0, 0.063], after)).T, "-", color=BLUE, lw=1.4)
    axes.text(*(centre + [0.0645, 0.0]), "heading\nbefore", color=GREY, va="center")
    axes.text(*(centre + 0.065 * after), "heading\nafter", color=BLUE, va="bottom")
    angle_arc(axes, centre, 0.053, 0.0, dtheta, RED)
    axes.text(*(centre + [0.056, 0.0135]), "dtheta", color=RED, size=15, va="center")


def prepare(axes: Axes, title: str, x: tuple[float, float], y: tuple[float, float]) -> None:
    """Equal scales, no frame, the title in bold."""
    axes.set(xlim=x, ylim=y, aspect="equal")
    axes.axis("off")
    axes.set_title(title, weight="bold", size=14)


def arrow(axes: Axes, start: np.ndarray, end: np.ndarray, colour: str, *, width: float) -> None:
    """A straight arrow from start to end."""
    style = {"arrowstyle": "-|>", "color": colour, "lw": width, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 16}
    axes.annotate("", end, start, arrowprops=style, zorder=5)


def angle_arc(axes: Axes, centre: np.ndarray, radius: float, start: float, end: float, colour: str) -> None:
    """An arc about a centre from one angle to another, rad, with an arrowhead at its end."""
    low, high = np.degrees([start, end])
    axes.add_patch(Arc(tuple(centre), 2 * radius, 2 * radius, theta1=low, theta2=high, ec=colour, lw=2.2, zorder=5))
    head = [centre + radius * np.array([np.cos(a), np.sin(a)]) for a in (end - 0.06, end)]
    arrow(axes, head[0], head[1], colour, width=2.2)


def leader(colour: str) -> dict[str, object]:
    """A thin line from a label to what it names."""
    return {"arrowstyle": "-", "color": colour, "lw": 1.0}


if __name__ == "__main__":
    plt.rcParams.update({"font.size": 12})
    main()
