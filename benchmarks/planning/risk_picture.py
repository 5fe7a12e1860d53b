# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One problem of risk.py, planned without and with uncertainty, and what happens in repeated runs.

OPENBLAS_NUM_THREADS=1 python -m benchmarks.planning.risk_picture [--problem K] [--model FILE] [--out FILE]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.planning.risk import SEED, STRIDE, WINDOW, plan, repertoires, trained
from benchmarks.planning.risk_table import VARIANTS
from benchmarks.planning.risk_tasks import TASKS, Problem, problem
from push_predictor.models.store.model_file import load_model
from push_predictor.planning.obstacles.around_obstacles import PlannedPushes
from push_predictor.planning.obstacles.targets import PoseTarget
from push_predictor.reporting.canvas import OBSERVED, PREDICTED, draw, outside_legend
from push_predictor.reporting.slider_picture import GOAL_COLOUR, OBSTACLE_COLOUR, paint_outline
from push_predictor.simulation.interactive_rig import push_motion
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array, BoolArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OUT = Path(__file__).resolve().parents[2] / "docs" / "pictures" / "planning_risk.png"
TASK = TASKS[2]
RUNS = 40
CLOUD = 200  # samples shown
SPREAD = 1e-6  # m, rad; below it a plan was made without uncertainty
SHOWN = (-0.19, 0.19, -0.13, 0.13)  # m


@dataclass(frozen=True, eq=False)
class Repeats:
    """The plan, the end poses (r, 3) of repeated runs, and which failed or reached the target (r,)."""

    plan: PlannedPushes
    ends: Array
    failed: BoolArray
    reached: BoolArray


def main(arguments: list[str] | None = None) -> int:
    """Plan, repeat and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problem", type=int, default=485)
    parser.add_argument("--model", type=Path, help="a model of bags/square_abs_train (default: train one)")
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args(arguments)
    model = load_model(options.model) if options.model else trained()
    variants, shown = repertoires(model), problem(TASK, options.problem, model.rig.outline)
    pair = []
    for name in (VARIANTS[0], VARIANTS[-1]):
        found = plan(TASK, variants[name], shown, shown.start)
        if found is None:
            print(f"problem {options.problem}: no plan of variant {name}")
            return 1
        pair.append(repeated(found[0], shown))
        print(
            f"{name}: {len(found[0].pushes)} pushes, {pair[-1].failed.sum()} failed, {pair[-1].reached.sum()} reached"
        )
    draw(options.out, (7.6, 3.8), lambda figure: _paint(figure, shown, pair))
    return 0


def repeated(found: PlannedPushes, shown: Problem) -> Repeats:
    """Execute a plan RUNS times without looking; only the noise differs."""
    sliders = np.tile(shown.start, (RUNS, 1))
    failed = np.zeros(RUNS, dtype=np.bool_)
    for turn, (push, windows) in enumerate(zip(found.pushes.inputs, found.pushes.windows, strict=True)):
        velocity, contact, angle = np.tile(push, (RUNS, 1)).T
        commands = PushPlan(contact, angle, velocity, velocity * WINDOW * float(windows))
        path = push_motion(SimulationSpec("rect1", "abs", commands, seed=SEED + turn), sliders).slider
        failed |= ~shown.scene.safe(np.concatenate([path[:, ::STRIDE], path[:, -1:]], axis=1)).all(axis=1)
        sliders = np.where(failed[:, None], sliders, path[:, -1])
    return Repeats(found, sliders, failed, ~failed & shown.target.reached(sliders))


def _paint(figure: Figure, shown: Problem, pair: list[Repeats]) -> None:
    for axes, repeats, name in zip(figure.subplots(1, 2, sharey=True), pair, ("without", "with"), strict=True):
        _scene(axes, shown)
        _plan(axes, shown, repeats)
        axes.set_title(
            f"Planned {name} uncertainty: {len(repeats.plan.pushes)} pushes\n"
            f"{repeats.reached.sum()} of {RUNS} runs reach the region, {repeats.failed.sum()} hit the wall",
            loc="left",
        )
        axes.label_outer()
    named = {
        label: handle for axes in figure.axes for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    legend = outside_legend(figure, named.values(), named.keys(), side="below", ncols=3, markerscale=1.5)
    for handle in legend.legend_handles:
        if handle is not None:
            handle.set_alpha(0.4 if handle.get_label() == "region for the slider's centre" else 1.0)


def _scene(axes: Axes, shown: Problem) -> None:
    for obstacle in shown.scene.obstacles:
        axes.fill(*(1e3 * obstacle.vertices.T), color=OBSTACLE_COLOUR)
    if isinstance(shown.target, PoseTarget):
        circle = np.linspace(0.0, 2.0 * np.pi, 80)
        ring = shown.target.goal.distance * np.column_stack([np.cos(circle), np.sin(circle)])
        centre = shown.target.goal.pose[:2]
        axes.fill(*(1e3 * (centre + ring).T), color=GOAL_COLOUR, alpha=0.25, label="region for the slider's centre")
    low_x, high_x, low_y, high_y = (1e3 * value for value in SHOWN)
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)", xlim=(low_x, high_x), ylim=(low_y, high_y))


def _plan(axes: Axes, shown: Problem, repeats: Repeats) -> None:
    paint_outline(axes, shown.scene.outline, repeats.plan.poses[0], color="black", linewidth=1.4, label="start")
    for pose in repeats.plan.poses[1:-1]:
        paint_outline(axes, shown.scene.outline, pose, color=PREDICTED, linewidth=0.7, alpha=0.4)
    paint_outline(
        axes,
        shown.scene.outline,
        repeats.plan.poses[-1],
        color=PREDICTED,
        linewidth=1.2,
        label="planned: slider after each push",
    )
    if repeats.plan.samples[-1].std() > SPREAD:
        cloud = 1e3 * repeats.plan.samples[-1][:CLOUD, :2].T
        axes.plot(*cloud, ".", color=PREDICTED, markersize=1.5, alpha=0.4, label="predicted: end of a run")
    good, bad = repeats.ends[~repeats.failed], repeats.ends[repeats.failed]
    axes.plot(*(1e3 * good[:, :2].T), ".", color=OBSERVED, markersize=5, label="simulated: end of a run")
    if len(bad):
        axes.plot(
            *(1e3 * bad[:, :2].T),
            "x",
            color="#c0203a",
            markersize=6,
            label="simulated: the next push hits the wall",
        )


if __name__ == "__main__":
    sys.exit(main())
