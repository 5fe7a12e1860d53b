# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A push whose mechanics differ a little from the base model's, where the difference may change along the path.

The ellipsoidal limit surface (f / fmax)^2 + (m / mmax)^2 = 1 becomes f' W f / fmax^2 + ... with a symmetric W near the
identity, and a pull g (in units of fmax and mmax) is added to the load: v = k (W (f + g)), w = k (m + g_m) / c^2.
The difference may depend on the slider's pose and load. Everything is correct to first order, which is enough for a
response.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.limit_surface import contact_force
from push_predictor.models.mechanisms.mechanism import Push
from push_predictor.types import Array, IntArray

FEWEST_STEPS = 4  # of a window; a response is a difference, the error of the steps is nearly the same on both sides
LONGEST_STEP = 0.005  # m of a whole push


@dataclass(frozen=True, eq=False)
class State:
    """The state of n sliders, by the base model.

    turn (n,): rad since the start. load (n, 3): force along the body's x and y and moment, in units of fmax and mmax,
    on the limit surface; zero without contact. slip (n,): 1 where the pusher slips to the left of the inward
    normal, -1 to the right, 0 where it sticks. bend (n, 3): change of the slider's velocity (in the frame of the first
    pose, per velocity of the tip) per metre of the tip's path.
    """

    turn: Array
    load: Array
    slip: IntArray
    bend: Array


@dataclass(frozen=True, eq=False)
class Change:
    """What differs from the base model at a state, for n sliders, in the body frame.

    stretch (n, 2): W = [[1 + a, b], [b, 1 - a]]. pull (n, 3): a further load, in units of fmax and mmax.
    spread (n,): logarithm of the factor on c. centre (n, 2): shift of the centre of friction, m. friction (n,): added
    to the contact friction.
    """

    stretch: Array
    pull: Array
    spread: Array
    centre: Array
    friction: Array


ChangeOf = Callable[[State, float], Change]


def no_change(n: int) -> Change:
    """The base model, to be altered with dataclasses.replace."""
    return Change(np.zeros((n, 2)), np.zeros((n, 3)), np.zeros(n), np.zeros((n, 2)), np.zeros(n))


def response_to(changes: Sequence[ChangeOf], step: float, physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per unit of each change (n, 3, p), by central differences: change(state, amount), amount +- step."""
    moved = displaced(physics, push, [(change, amount) for change in changes for amount in (step, -step)])
    return np.moveaxis(moved[0::2] - moved[1::2], 0, 2) / (2.0 * step)


def displaced(physics: AnalyticalPush, push: Push, tried: Sequence[tuple[ChangeOf, float]]) -> Array:
    """Displacements (k, n, 3) in the push frame under each of k changes by an amount, computed as one set of pushes.

    Without a change, as AnalyticalPush.displacement gives it.
    """
    k, n = len(tried), len(push.inputs)

    def together(state: State) -> Change:
        states = (State(*(values[i * n : (i + 1) * n] for values in vars(state).values())) for i in range(k))
        each = [change(part, amount) for part, (change, amount) in zip(states, tried, strict=True)]
        return Change(*(np.concatenate(values) for values in zip(*(vars(one).values() for one in each), strict=True)))

    moved = _swept(physics, np.tile(push.inputs, (k, 1)), np.tile(push.duration, k), together)
    return moved.reshape(k, n, 3)


def _swept(physics: AnalyticalPush, inputs: Array, duration: Array, change: Callable[[State], Change]) -> Array:
    """Displacement (n, 3) with what differs at a state."""
    velocity, contact, angle = inputs.T
    normal = physics.outline.inward_normal(contact)
    ahead = rotate(normal, angle)
    start = physics.outline.point(contact) - physics.pusher_radius * normal
    path_length = velocity * duration
    steps = max(FEWEST_STEPS, int(np.ceil(np.max(path_length, initial=0.0) / LONGEST_STEP)))
    step = path_length / steps
    pose = np.zeros((len(path_length), 3))
    for k in range(steps):
        begin, middle = (start + ((k + share) * step)[:, None] * ahead for share in (0.0, 0.5))
        half = 0.5 * step[:, None]
        base, first = _rates(physics, pose, begin, ahead, change)
        _, second = _rates(physics, pose + half * first, middle, ahead, change, before=(base, half))
        pose = pose + step[:, None] * second
    heading = np.arctan2(ahead[:, 1], ahead[:, 0])
    return np.column_stack([rotate(pose[:, :2], -heading), pose[:, 2]])


@dataclass(frozen=True, eq=False)
class _Touch:
    """Contact point, inward normal, its left and the tip's velocity, (n, 2) each, in the body frame."""

    point: Array
    normal: Array
    left: Array
    velocity: Array


def _rates(
    physics: AnalyticalPush,
    pose: Array,
    tip: Array,
    ahead: Array,
    change: Callable[[State], Change],
    before: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:
    """Change of the pose (n, 3) per metre of the tip's path, by the base model and with the change.

    before: the base model's rate at an earlier place, and the path length (n, 1) since: they give the bend.
    """
    turn = pose[:, 2]
    nearest = physics.outline.project(to_body(tip, pose))
    normal = -nearest.normal
    touch = _Touch(nearest.point, normal, np.column_stack([-normal[:, 1], normal[:, 0]]), rotate(ahead, -turn))
    twist, load, slip = _solve(physics, touch, no_change(len(turn)))
    base = _in_first_frame(twist, turn)
    bend = np.zeros_like(base) if before is None else (base - before[0]) / np.maximum(before[1], np.finfo(float).tiny)
    differs = change(State(turn, load, slip, bend))
    return base, _in_first_frame(_solve(physics, touch, differs)[0], turn)


def _in_first_frame(twist: Array, turn: Array) -> Array:
    return np.column_stack([rotate(twist[:, :2], turn), twist[:, 2]])


def _solve(physics: AnalyticalPush, touch: _Touch, change: Change) -> tuple[Array, Array, IntArray]:
    """Twist (n, 3) of the body's origin, load (n, 3) and slip (n,) under a touch; see limit_surface.contact_force."""
    length = physics.support.length * np.exp(change.spread)
    centre = np.asarray(physics.support.centre) + change.centre
    friction = np.maximum(physics.contact_friction + change.friction, 0.0)
    arm = (touch.point - centre) / length[:, None]
    twist, load, slip = _driven(touch, arm, touch.velocity, change.stretch, friction)
    if np.any(change.pull):
        size = np.linalg.norm(twist, axis=1)[:, None]
        drift = size * np.column_stack([_times(change.stretch, change.pull[:, :2]), change.pull[:, 2]])
        at_touch = drift[:, :2] + drift[:, 2:] * np.column_stack([-arm[:, 1], arm[:, 0]])
        twist, load, slip = _driven(touch, arm, touch.velocity - at_touch, change.stretch, friction)
        twist = twist + drift
    spin = twist[:, 2] / length
    moved = twist[:, :2] + spin[:, None] * np.column_stack([centre[:, 1], -centre[:, 0]])
    return np.column_stack([moved, spin]), load, slip


def _driven(
    touch: _Touch, arm: Array, velocity: Array, stretch: Array, friction: Array
) -> tuple[Array, Array, IntArray]:
    """Twist (n, 3: the centre of friction's velocity, spin times c), load (n, 3) of length 1, slip (n,)."""
    normal, left = touch.normal, touch.left
    p = arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]
    q = arm[:, 0] * left[:, 1] - arm[:, 1] * left[:, 0]
    along_normal, along_left = _times(stretch, normal), _times(stretch, left)
    nn, nt = np.sum(normal * along_normal, axis=1) + p * p, np.sum(normal * along_left, axis=1) + p * q
    tt = np.sum(left * along_left, axis=1) + q * q
    along, across = np.sum(velocity * normal, axis=1), np.sum(velocity * left, axis=1)
    fn, ft, slip = contact_force(nn, nt, tt, along, across, friction)
    force, moment = fn[:, None] * normal + ft[:, None] * left, p * fn + q * ft
    load = np.column_stack([force, moment])
    size = np.linalg.norm(load, axis=1)[:, None]
    unit = load / np.where(size > 0.0, size, 1.0)
    return np.column_stack([_times(stretch, force), moment]), unit, slip


def _times(stretch: Array, vectors: Array) -> Array:
    """W times vectors (n, 2)."""
    a, b = stretch.T
    x, y = vectors.T
    return np.column_stack([(1.0 + a) * x + b * y, b * x + (1.0 - a) * y])
