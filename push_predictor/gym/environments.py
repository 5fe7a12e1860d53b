# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The environment for many sliders, and for one: a vector environment of one."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from push_predictor.errors import RequestError
from push_predictor.gym import MOST_STEPS
from push_predictor.gym.pushed_sliders import PushedSliders
from push_predictor.gym.task import push_task
from push_predictor.planning.straight_drive import start_drive
from push_predictor.reporting.canvas import NEARBY, OBSERVED, pixels
from push_predictor.reporting.slider_picture import OBSTACLE_COLOUR, paint_circle, paint_goal, paint_outline, paint_push
from push_predictor.types import Array, BoolArray, ByteArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Info = dict[str, Any]
SIZE = (4.0, 4.0)  # inches: 640 x 640 pixels


class PushEnv(gymnasium.Env[Array, Array]):
    """Push a slider to a goal pose, with outcomes drawn from a model: `push_predictor/Push-v0`.

    **Success**: the position is within 5 mm and the heading within 0.1 rad of the goal after a window, unless the goal
    is a `Goal` with tolerances of its own; for a circle any heading. The episode terminates then, and also when the
    outline touches an obstacle or the centre of mass leaves the table. It is truncated after 100 windows.

    **Action**, three numbers from -1 to 1: contact (once around the outline), angle to the inward normal and velocity
    (both over the model's domain). A step is one window of the model's training duration: the tip is placed at the
    contact at once, and moves in a straight line. A contact within a tip's radius of that of the window before goes on
    with the same push, any other begins a new one.

    **Observation**, four numbers: x, y (m) of the goal in the slider's frame, and cosine and sine of its heading there.
    Hidden is the error that the windows of a push share: from the last observations and actions, a policy can estimate
    it for the push under way. Given nothing but the observation, the next one has the model's predicted distribution.

    **Reward**: by how much the distance to the goal decreases, where the distance is the error of the position plus
    that of the heading, each in tolerances; and 10 at success.

    **info**: is_success, touches, off_table, in_domain (whether the training data support the push), and slider and
    goal (x, y m, heading rad) in the world.

    model: a model file, a model, or "default" for the shipped one. goal: a pose (x, y m, heading rad) or a `Goal`.
    obstacles: convex polygons, above which the tip may pass; table: one, by default a square of 0.5 m about the origin;
    corners counter-clockwise, m. start: a pose; by default each episode starts at a random one.

    Raises RequestError, and ModelFileError for a file.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 5}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(self, render_mode: str | None = None, **arguments: Any) -> None:
        self._one = PushVectorEnv(1, sys.maxsize, **arguments)
        self.render_mode = render_mode
        self.action_space, self.observation_space = self._one.single_action_space, self._one.single_observation_space

    def reset(self, *, seed: int | None = None, options: Info | None = None) -> tuple[Array, Info]:
        """Begin an episode; the same seed and actions give the same episodes. There are no options."""
        super().reset(seed=seed)
        observations, infos = self._one.reset(seed=[seed])
        return observations[0], _first(infos)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, Info]:
        """Push by one window."""
        observations, rewards, terminated, _, infos = self._one.step(np.asarray(action)[None])
        return observations[0], float(rewards[0]), bool(terminated[0]), False, _first(infos)

    def render(self) -> ByteArray | None:
        """The scene as pixels (height, width, 3), with the render mode rgb_array."""
        return frame(self._one._sliders, 0) if self.render_mode else None


class PushVectorEnv(VectorEnv[Array, Array, Array]):
    """`num_envs` environments like PushEnv, computed together; an episode that ended begins again at the next step.

    Slider k of `reset(seed=s)` behaves exactly as a PushEnv with the seed s + k. The other arguments are PushEnv's.
    """

    metadata = {**PushEnv.metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 - as above

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int = MOST_STEPS,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        for name, value in (("num_envs", num_envs), ("max_episode_steps", max_episode_steps)):
            if value < 1:
                raise RequestError(name, value, "a number above 0")
        task = push_task(**arguments)
        window = task.model.model.input_limits.velocity[1] * task.model.model.usual_duration
        far = np.hypot(*np.ptp(task.scene.table.vertices, axis=0)) + 2.0 * window  # a window beyond the table, at most
        high = np.array([far, far, 1.0, 1.0], dtype=np.float32)
        self.single_action_space, self.single_observation_space = Box(-1.0, 1.0, (3,)), Box(-high, high)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.num_envs, self.render_mode = num_envs, render_mode
        self._sliders, self._most_steps = PushedSliders(task, num_envs), max_episode_steps
        self._steps, self._ended = np.zeros(num_envs, dtype=np.int64), np.zeros(num_envs, dtype=np.bool_)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Info | None = None
    ) -> tuple[Array, Info]:
        """Begin an episode for all. seed: one for each slider, or one that is increased by 1 from slider to slider."""
        if seed is None or isinstance(seed, int):
            seed = [None if seed is None else seed + row for row in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise RequestError("seed", list(seed), f"one number, or {self.num_envs}")
        for row, value in enumerate(seed):
            if value is not None or self._sliders.generators[row] is None:
                self._sliders.seed(row, np_random(value)[0])
        self._steps[:], self._ended[:] = 0, False
        self._sliders.place(np.arange(self.num_envs))
        return self._observed(), self._infos()

    def step(self, actions: Array) -> tuple[Array, Array, BoolArray, BoolArray, Info]:
        """Push every slider by one window, and begin the next episode where the last one ended."""
        actions = np.asarray(actions, dtype=np.float64)
        if actions.shape != (self.num_envs, 3) or not np.isfinite(actions).all():
            accepted = f"finite numbers from -1 to 1 of shape {self.num_envs, 3}: contact, angle, velocity"
            raise RequestError("action", actions.tolist(), accepted)
        rows, reward = np.flatnonzero(~self._ended), np.zeros(self.num_envs)
        self._sliders.place(np.flatnonzero(self._ended))
        reward[rows] = self._sliders.push(rows, actions[rows])
        self._steps = np.where(self._ended, 0, self._steps + 1)
        terminated, truncated = self._sliders.ended, self._steps >= self._most_steps
        self._ended = terminated | truncated
        return self._observed(), reward, terminated, truncated, self._infos()

    def render(self) -> tuple[ByteArray, ...] | None:
        """One picture for each slider, with the render mode rgb_array."""
        return tuple(frame(self._sliders, row) for row in range(self.num_envs)) if self.render_mode else None

    def _observed(self) -> Array:
        return self._sliders.task.observation(self._sliders.poses)

    def _infos(self) -> Info:
        flags = {name: flag.copy() for name, flag in self._sliders.flags.items()}
        goal = np.tile(self._sliders.task.goal.pose, (self.num_envs, 1))
        return {"slider": self._sliders.poses.copy(), "goal": goal, **flags}


def _first(infos: Info) -> Info:
    """The info of the only slider."""
    return {name: bool(value[0]) if value.ndim == 1 else value[0] for name, value in infos.items()}


def frame(sliders: PushedSliders, row: int) -> ByteArray:
    """Pixels (height, width, 3) of one slider. Raises PushPredictorError if matplotlib is not installed."""
    return pixels("render", SIZE, lambda figure: _paint(figure, sliders, row))


def _paint(figure: Figure, sliders: PushedSliders, row: int) -> None:
    task, axes = sliders.task, figure.subplots()
    scene, goal, inputs = task.scene, task.goal, sliders.inputs[row]
    axes.fill(*(1e3 * scene.table.vertices.T), facecolor="none", edgecolor=NEARBY)
    for obstacle in scene.obstacles:
        axes.fill(*(1e3 * obstacle.vertices.T), color=OBSTACLE_COLOUR)
    paint_goal(axes, scene.outline, goal.pose, goal.distance)
    if np.isfinite(inputs).all():
        before, radius = sliders.before[row], task.model.model.rig.pusher_radius
        paint_outline(axes, scene.outline, before, color=NEARBY, linewidth=0.9)
        tip = start_drive(scene.outline, radius, before[None], inputs[None])[0].start[0]
        paint_circle(axes, tip, radius, color="black", linewidth=1.2)
        paint_push(axes, scene.outline, before, inputs, inputs[0] * task.model.model.usual_duration)
    paint_outline(axes, scene.outline, sliders.poses[row], color=OBSERVED)
    left, bottom = 1e3 * (scene.table.vertices.min(axis=0) - scene.outline.reach)
    right, top = 1e3 * (scene.table.vertices.max(axis=0) + scene.outline.reach)
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)", xlim=(left, right), ylim=(bottom, top))
