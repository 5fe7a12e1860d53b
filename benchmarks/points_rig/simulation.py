# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The pushes of a session, simulated in small steps of the tip's path, all pushes of equal rank in step."""

from dataclasses import dataclass

import numpy as np

from benchmarks.points_rig.balance import Contact, solve
from benchmarks.points_rig.drivers import View
from benchmarks.points_rig.effects import Conditions, Effect
from benchmarks.points_rig.outlines import Nearest
from benchmarks.points_rig.rigs import PUSHER_RADIUS, Rig
from benchmarks.points_rig.sessions import Session
from benchmarks.support.plane import Array, BoolArray, IntArray, cross, direction, dot, quarter_turn, rotate

STEP = 0.00025  # m of the tip's path
MEMORY = 0.006  # m of path over which the frictions vary
NOISE = np.array([0.10, 0.10, 0.15, 0.12])  # of the load's tilt in x and y, its spread, and log of contact friction
POINT_NOISE, SURFACE_NOISE = 0.15, 0.04  # of each point's log load and of the log surface friction, push to push


@dataclass(frozen=True)
class Noise:
    """Random variation of the frictions: fixed by its seed, whatever the effects."""

    within: Array  # (K, P, 4), tilt x, tilt y, spread, log contact friction
    points: Array  # (P, N), log load
    surface: Array  # (P,), log surface friction


@dataclass(frozen=True)
class Tracks:
    """Simulated paths on a grid of K steps: world axes, m, rad, N."""

    pose: Array  # (K + 1, P, 3), of the slider
    force: Array  # (K, P, 2), of the slider on the tip, in each step
    normal: Array  # (K, P, 2), into the slider, in each step
    origin: Array  # (P, 2), where the tip sets off
    heading: Array  # (P,), world direction of the push
    failed: BoolArray  # (K, P), steps whose balance did not converge

    def at(self, pushes: IntArray, path: Array) -> Array:
        """Poses (S, 3) of the slider at paths of the tip (S,) in the given pushes (S,)."""
        place = np.clip(path / STEP, 0.0, len(self.force) - 1e-9)
        step = place.astype(np.int64)
        before, after = self.pose[step, pushes], self.pose[step + 1, pushes]
        return np.asarray(before + (place - step)[:, None] * (after - before))


def draw_noise(random: np.random.Generator, rig: Rig, session: Session, ratio: float = 1.0) -> Noise:
    """Half the variance is fixed for a push, half wanders within it; `ratio` multiplies the amplitudes."""
    from scipy.signal import lfilter  # its import takes half a second

    steps, pushes = int(np.ceil(session.length.max() / STEP)), len(session)
    keep = float(np.exp(-STEP / MEMORY))
    shocks = random.normal(0.0, 1.0, (steps, pushes, 4)) * np.sqrt(1 - keep**2)
    shocks[0] /= np.sqrt(1 - keep**2)
    wander = lfilter([1.0], [1.0, -keep], shocks, axis=0)
    fixed = random.normal(0.0, 1.0, (pushes, 4))
    scale = rig.noise * ratio
    return Noise(
        within=scale * NOISE * np.sqrt(0.5) * (wander + fixed),
        points=scale * POINT_NOISE * random.normal(0.0, 1.0, (pushes, len(rig.loads))),
        surface=SURFACE_NOISE * random.normal(0.0, 1.0, pushes),
    )


def simulate(rig: Rig, session: Session, noise: Noise, effects: tuple[Effect, ...] = ()) -> Tracks:
    """Simulate all pushes; those that begin where another ended come after it."""
    steps, pushes = len(noise.within), len(session)
    paths = (np.zeros((steps + 1, pushes, 3)), np.zeros((steps, pushes, 2)), np.zeros((steps, pushes, 2)))
    tracks = Tracks(*paths, np.zeros((pushes, 2)), np.zeros(pushes), np.zeros((steps, pushes), dtype=np.bool_))
    rank = np.zeros(pushes, dtype=np.int64)
    for push in np.flatnonzero(session.chained):
        rank[push] = rank[push - 1] + 1
    for level in range(int(rank.max()) + 1):
        rows = np.flatnonzero(rank == level)
        tracks.pose[0, rows] = session.pose[rows] if level == 0 else tracks.pose[-1, rows - 1]
        _aim(rig, session, rows, tracks)
        _advance(rig, session, noise, effects, rows, tracks)
    return tracks


def _aim(rig: Rig, session: Session, rows: IntArray, tracks: Tracks) -> None:
    """Place the tip before each push."""
    pose = tracks.pose[0, rows]
    point, normal = rig.outline.at(session.contact[rows])
    touch = pose[:, :2] + rotate(point - PUSHER_RADIUS * normal, pose[:, 2])
    heading = np.arctan2(normal[:, 1], normal[:, 0]) + pose[:, 2] + session.angle[rows]
    tracks.heading[rows] = heading
    tracks.origin[rows] = touch - session.gap[rows, None] * direction(heading)


def _advance(
    rig: Rig, session: Session, noise: Noise, effects: tuple[Effect, ...], rows: IntArray, tracks: Tracks
) -> None:
    """Move the tips of some pushes along their paths and fill in the tracks."""
    guess = np.zeros((len(session), 2))
    for step in range(len(noise.within)):
        tracks.pose[step + 1, rows] = tracks.pose[step, rows]
        length = np.minimum(session.length[rows] - step * STEP, STEP)
        moving, length = rows[length > 1e-9], length[length > 1e-9]
        pose = tracks.pose[step, moving]
        tip = tracks.origin[moving] + step * STEP * direction(tracks.heading[moving])
        nearest = rig.outline.nearest(rotate(tip - pose[:, :2], -pose[:, 2]))
        view = View(session, moving, pose, nearest.edge, step * STEP - session.gap[moving])
        conditions = _conditions(rig, noise, view, step)
        for effect in effects:
            effect.apply(conditions, view, rig)
        touching, contact = _contact(rig, view, conditions, tip, nearest, length, tracks.heading[moving])
        pushed = moving[touching]
        if not len(pushed):
            continue
        contact = contact.rows(touching)
        motion = solve(contact, guess[pushed])
        guess[pushed] = motion.unknowns
        place = rotate(nearest.point[touching], pose[touching, 2])
        velocity = motion.contact_velocity - motion.turning[:, None] * quarter_turn(place)
        tracks.pose[step + 1, pushed, :2] += length[touching, None] * velocity
        tracks.pose[step + 1, pushed, 2] += length[touching] * motion.turning
        tracks.force[step, pushed] = -motion.force * (rig.resistance * conditions.surface[touching])[:, None]
        tracks.normal[step, pushed] = contact.normal
        tracks.failed[step, pushed] = ~motion.converged


def _conditions(rig: Rig, noise: Noise, view: View, step: int) -> Conditions:
    """The rig's conditions with their random variation, before any effect."""
    count, within = len(view.pushes), noise.within[step, view.pushes]
    lean = (rig.supports - rig.load_centre) / rig.load_radius
    features = np.column_stack([lean, np.linalg.norm(lean, axis=1)])
    return Conditions(
        exponent=noise.points[view.pushes] + within[:, :3] @ features.T,
        roughness=np.ones((count, len(rig.loads))),
        contact_friction=rig.contact_friction * np.exp(within[:, 3]),
        surface=np.exp(noise.surface[view.pushes]),
        world_anisotropy=np.zeros((count, 2)),
        body_anisotropy=np.zeros((count, 2)),
        pull=np.zeros((count, 2)),
        moment=np.zeros(count),
        offset=np.zeros(count),
        roll=np.zeros(count),
        dent=np.zeros(count),
    )


def _contact(
    rig: Rig, view: View, conditions: Conditions, tip: Array, nearest: Nearest, length: Array, heading: Array
) -> tuple[IntArray, Contact]:
    """The balance of each push, and the rows in which the tip reaches the slider within the step."""
    angle = view.pose[:, 2]
    place = rotate(nearest.point, angle)
    touch = place + view.pose[:, :2]
    normal = (touch - tip) / nearest.distance[:, None]
    tangent, velocity = quarter_turn(normal), direction(heading)
    closing = dot(normal, velocity) - (nearest.distance - PUSHER_RADIUS + conditions.dent) / length
    along = dot(tangent, velocity) + conditions.roll
    loads = rig.loads * np.exp(conditions.exponent)
    loads = loads / loads.sum(axis=1, keepdims=True) * conditions.roughness
    scale = rig.resistance * conditions.surface
    contact = Contact(
        arms=rotate(rig.supports[None], angle[:, None]) - place[:, None, :],
        loads=loads,
        resistance=_resistance(conditions, angle),
        normal=normal,
        drive=np.maximum(closing, 0.0)[:, None] * normal + along[:, None] * tangent,
        friction=conditions.contact_friction,
        pull=conditions.pull / scale[:, None],
        moment=(conditions.moment - cross(place, conditions.pull)) / scale,
        offset=conditions.offset,
    )
    return np.flatnonzero(closing > 1e-9), contact


def _resistance(conditions: Conditions, angle: Array) -> Array:
    """The inverse (P, 3) of W = 1 + world part + body part, as xx, xy, yy."""
    doubled = rotate(conditions.body_anisotropy, 2 * angle) + conditions.world_anisotropy
    a, b = doubled[:, 0], doubled[:, 1]
    return np.stack([1 - a, -b, 1 + a], axis=1) / (1 - a**2 - b**2)[:, None]
