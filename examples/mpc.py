# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Sampling MPC: push a square to a goal pose, and plan again every 0.1 s. `python -m examples.mpc`.

MPPI (Williams et al. 2017) over contact, direction and speed. predict_server predicts all samples, one call of
predict_push_batch for each window ahead. The cost is the expected time to the goal in s, which grows with the
covariance. The rig is simulated; it publishes slider/pose and pusher/pose.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from examples.mpc_picture import Window, draw_windows
from examples.planner_client import PlannerClient
from examples.processes import node
from examples.square import SCENE, square_model, square_pusher, square_spec
from push_predictor.errors import RequestError
from push_predictor.geometry.frames import to_world
from push_predictor.planning.goal import Goal
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.tip_paths import SliderPaths, slider_paths
from push_predictor.planning.unscented import Predict, PusherGeometry
from push_predictor.simulation.interactive_rig import LiveRig
from push_predictor.types import Array

OUT = Path(__file__).resolve().parents[1] / "out" / "mpc"
STEPS, SAMPLES, KNOTS, LIMIT = (1, 1, 2, 2, 3, 3), 128, 3, 150  # windows of each step ahead; windows of a run
SPEED, STEEPEST = (0.01, 0.05), 1.2  # m/s, rad from the inward normal: in the model's domain
SPREAD, TEMPERATURE = np.array([0.01, 0.02, 0.3]), 0.03  # of samples about a plan: m/s, contact, rad; s
PLACING, MISS, TOUCH, PACE = 2.0, 8.0, 20.0, 0.01  # s to place the tip, lost by a miss, by a touch; m/s of approach
BASIS = np.maximum(0.0, 1.0 - np.abs(np.linspace(0.0, KNOTS - 1.0, len(STEPS))[:, None] - np.arange(KNOTS)))
START, GOAL = np.array([-0.06, -0.03, 0.4]), Goal([0.06, 0.02, 0.0], distance=0.002, turn=0.05)


class Plan(NamedTuple):
    """window (3: speed m/s, contact, direction in the world rad), at a tip to `place` or not; path as predicted."""

    window: Array
    place: bool
    poses: Array
    covariance: Array


class SamplingMpc:
    """Plans for one goal. predict: of windows that last pusher.window s. scene: table and obstacles."""

    def __init__(self, predict: Predict, pusher: PusherGeometry, goal: Goal, scene: Scene) -> None:
        self._predict, self._pusher, self._goal, self._scene = predict, pusher, goal, scene
        self._random, self._last = np.random.default_rng(0), np.zeros((len(STEPS), 3))

    def plan(self, slider: Array, tip: Array | None) -> Plan:
        """Plan for a slider (3,) and a tip (2,), None if it is lifted. Raises RequestError.

        Half of the samples keep the contact, about the last plan; the others place the tip anywhere. If one of these is
        best, samples about it follow. The plan is the mean with weights exp(-cost / TEMPERATURE).
        """
        keep = 0 if tip is None else SAMPLES // 2
        samples = np.concatenate([self._about(self._last, keep), self._anywhere(slider, SAMPLES - keep)])
        cost, paths = self._rolled(slider, tip, samples, keep)
        place = int(np.argmin(cost)) >= keep
        if place:
            samples = self._about(samples[np.argmin(cost)], SAMPLES)
            cost, paths = self._rolled(slider, None, samples, 0)
        cost[SAMPLES if place else keep :] = np.inf
        best = int(np.argmin(cost))
        if not np.isfinite(cost[best]):
            raise RequestError("samples", 0, "a model with at least one in its domain")
        weight = np.exp((cost[best] - cost) / TEMPERATURE)
        mean = np.tensordot(weight / weight.sum(), samples, 1)
        self._last = np.concatenate([mean[1:], mean[-1:]])
        return Plan(mean[0], place, paths.poses[best], paths.covariance[best])

    def cost(self, paths: SliderPaths) -> Array:
        """Least expected time (n,) in s to the goal of n paths, each of which may end after any window."""
        square = self._goal.errors(paths.poses) ** 2 + np.diagonal(paths.covariance, axis1=2, axis2=3)
        cost = np.sqrt(square @ [1.0, 1.0, self._pusher.outline.polar_moment]) / PACE
        cost += MISS * (1.0 - self._goal.likely(paths.poses, paths.covariance))
        cost += self._pusher.window * np.cumsum(STEPS)
        touch = self._scene.touch_probability(paths.poses, paths.covariance)
        cost += TOUCH * np.maximum.accumulate(touch, axis=1)
        return np.asarray(np.where(paths.known, cost, np.inf).min(axis=1))

    def _rolled(self, slider: Array, tip: Array | None, samples: Array, keep: int) -> tuple[Array, SliderPaths]:
        """Cost (n,) and paths of samples (n, h, 3), of which the first `keep` keep the tip."""
        outline, contact = self._pusher.outline, samples[:, 0, 1] % 1.0
        tips = to_world(outline.point(contact) - self._pusher.radius * outline.inward_normal(contact), slider)
        tips[:keep] = 0.0 if tip is None else tip
        paths = slider_paths(self._predict, self._pusher, slider, tips, samples[..., 0], samples[..., 2], STEPS)
        return self.cost(paths) + PLACING * (np.arange(len(samples)) >= keep), paths

    def _anywhere(self, slider: Array, count: int) -> Array:
        """Samples (count, h, 3: speed m/s, contact, direction in the world rad) of straight pushes at any contact."""
        speed, contact = self._random.uniform(*SPEED, count), self._random.random(count)
        x, y = self._pusher.outline.inward_normal(contact).T
        heading = slider[2] + np.arctan2(y, x) + self._random.uniform(-STEEPEST, STEEPEST, count)
        return np.repeat(np.column_stack([speed, contact, heading])[:, None], len(STEPS), axis=1)

    def _about(self, sample: Array, count: int) -> Array:
        """Samples (count, h, 3) about one (h, 3), which is the first; changes are linear between the knots."""
        drawn = SPREAD * self._random.standard_normal((count, KNOTS, 3)) * (np.arange(count) > 0)[:, None, None]
        samples = sample + np.einsum("hk,nkj->nhj", BASIS, drawn)
        return np.concatenate([np.clip(samples[..., :1], *SPEED), samples[..., 1:]], axis=-1)


def main(arguments: Sequence[str] = ()) -> int:
    """Push until the goal is reached; the exit status is 0 if it is."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, default=OUT / "square.pushmodel", help="a file; trained if there is none")
    parser.add_argument("--seed", type=int, default=1, help="of the rig's noise (default %(default)s)")
    options = parser.parse_args(arguments)
    OUT.mkdir(parents=True, exist_ok=True)
    pusher, rig = square_pusher(square_model(options.model)), LiveRig(square_spec(options.seed), START[None])
    with node("predict_server", {"models": [str(options.model)]}, logs=OUT), PlannerClient(pusher.window) as client:
        windows = run(SamplingMpc(client.predict, pusher, GOAL, SCENE), rig, client, pusher.window)
    reached, spent = GOAL.reached(GOAL.ahead(rig.sliders[0])), [1e3 * window.planning for window in windows]
    print(f"Goal {'reached' if reached else 'NOT reached'}: {len(windows)} windows, {rig.placed[0]} contacts.")
    print(f"Planning takes {np.median(spent):.0f} ms (median), {np.quantile(spent, 0.95):.0f} ms (95th percentile).")
    draw_windows(OUT / "mpc.png", windows, rig.sliders[0], GOAL, SCENE)
    return 0 if reached else 1


def run(mpc: SamplingMpc, rig: LiveRig, client: PlannerClient, duration: float) -> list[Window]:
    """Plan and push in turn until the slider rests at the goal, at most LIMIT windows; no faster than in real time."""
    only, windows = np.array([0]), list[Window]()
    while len(windows) < LIMIT:
        begun, slider = time.monotonic(), rig.sliders[0].copy()
        if GOAL.reached(GOAL.ahead(slider)) and GOAL.reached(GOAL.ahead(rig.stop(only)[0])):
            break
        plan = mpc.plan(slider, rig.tips[0] if rig.placed[0] else None)
        spent = time.monotonic() - begun
        if plan.place:
            rig.place(only, plan.window[1:2])
        windows.append(Window(slider, rig.tips[0].copy(), plan.place, plan.poses, plan.covariance, spent))
        rig.push(only, plan.window[:1], plan.window[2:], duration)
        client.publish_poses({"slider/pose": rig.sliders[0], "pusher/pose": np.append(rig.tips[0], 0.0)})
        time.sleep(max(0.0, begun + duration - time.monotonic()))
    return windows


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
