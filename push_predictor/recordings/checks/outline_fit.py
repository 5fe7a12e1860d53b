# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Fit yaw, shift and size of the outline, the clock lag and the tip's radius to the tip's positions in contact.

In contact the tip's centre is one tip radius from the outline. The gap that is left depends on the place of contact if
the outline is turned, shifted or of a wrong size, on the speed if the clocks are apart, and on the slider's heading and
place if the world frames of tracker and robot are apart. The standard deviations take each push as one observation: the
samples of a push share their errors.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from push_predictor.geometry.frames import rotate, to_body, to_world, wrap_angle
from push_predictor.geometry.outline import Outline, Projection
from push_predictor.geometry.shapes import near_symmetry, stretched, transformed
from push_predictor.recordings.checks.finding import Value
from push_predictor.recordings.checks.motion import Motion, body_velocity, sums_by_push
from push_predictor.recordings.rig import Rig
from push_predictor.types import Array, BoolArray, IntArray

YAW, X, Y, SIZE, LAG, TIP, FRAME_YAW, FRAME_X, FRAME_Y, STRETCH, SCALE, TOOL_X, TOOL_Y = range(13)
SIMILARITY = (YAW, X, Y, SIZE, LAG)
FRAMES = (FRAME_YAW, FRAME_X, FRAME_Y)
TOOL = (TOOL_X, TOOL_Y)
DOUBT = 4.0  # standard deviations that an estimate must exceed, in addition to its allowance
LENGTH_ALLOWANCE, ANGLE_ALLOWANCE, LAG_ALLOWANCE = 0.0005, np.radians(1.0), 0.01  # m, rad, s: marker and clock accuracy
FEWEST_CONTACTS = 20  # samples
# Prior sd of what the contacts do not determine, in the units of OutlineFit.
WEAK = np.array([1.0, 0.05, 0.05, 0.3, 0.2, 0.02, 1.0, 0.05, 0.05, 0.3, 0.1, 0.1, 0.1])
SMALLEST = -0.9  # relative correction of the size: a smaller slider is none
MOST_SAMPLES = 1200  # evenly drawn: more change the result by less than its standard deviation
UNKNOWN_SIZE = 0.02  # relative sd
NOISE = 1e-4  # m; a gap beyond this counts linearly, not squared
LARGEST = 0.01  # m; a larger gap counts as this much in the cost
CORNER = 0.003  # m
SHORT = 0.3  # of the median number of samples
DISTURBED = 0.001  # m; the spread from which on world frames are sought that are far apart
MOST_EVALUATIONS = 40  # of the gaps by a fit
SMALLEST_GAIN = 1e-4  # relative change of the cost at which a fit ends: it moves the estimate by a fraction of its sd
STARTS = 12  # turns from which the fit begins
TIE = 1.3  # ratio of the gaps up to which the smallest turn is preferred: an almost symmetric outline has several
NOISY = 4.0  # standard deviations of the median gap of a push
MEDIAN_SD = 1.25  # of a median, in standard deviations of the mean
MOST_PUSHES = 0.8  # share of the pushes that lie within `spread`: a push in five may be disturbed


@dataclass(frozen=True, eq=False)
class Contacts:
    """n samples in contact.

    tips (n, 2) m and velocities (n, 2) m/s of the tip in the slider's frame; push (n,): number of the push; poses
    (n, 3) of the slider in the world frame: x, y (m) and heading (rad). noise: standard deviation (m) of the outline's
    place in one sample. lag: of the slider's stamps, s, that is corrected in these samples. tool (n,): heading of the
    tool at the tip, rad; None if unknown.
    """

    tips: Array
    velocities: Array
    push: IntArray
    poses: Array
    noise: float = 0.0
    lag: float = 0.0
    tool: Array | None = None

    def at(self, rows: IntArray | BoolArray) -> Contacts:
        """The chosen samples: indices, or a mask (n,)."""
        own = {name: getattr(self, name)[rows] for name in ("tips", "velocities", "push", "poses")}
        return replace(self, **own, tool=None if self.tool is None else self.tool[rows])

    def drawn(self, count: int) -> Contacts:
        """At most `count` evenly drawn samples."""
        return self.at(np.unique(np.linspace(0, len(self.tips) - 1, count).astype(np.int64)))


def contacts_of(motion: Motion | None) -> Contacts | None:
    """The samples in contact, None if there are too few."""
    if motion is None or np.sum(motion.contact) < FEWEST_CONTACTS:
        return None
    touch = motion.touching
    tips = to_body(motion.tip, motion.slider)[touch]
    tool = None if motion.tool is None else motion.tool[touch]
    velocities, push, poses = body_velocity(motion)[touch], motion.push[touch], motion.slider[touch]
    return Contacts(tips, velocities, push, poses, motion.noise, tool=tool)


@dataclass(frozen=True, eq=False)
class OutlineFit:
    """A correction of the outline in the slider's frame, and its uncertainty.

    estimate (13,) and sd (13,): yaw (rad, counter-clockwise, about the centroid), shift along x and y (m), relative
    size minus 1, lag of the slider's stamps (s), correction of the tip's radius (m); turn (rad, about `centre`) and
    shift (m, m) that bring the tip from the pusher's world frame to the slider's; relative length along the outline's x
    minus that along its y; relative length of the slider's world frame over the pusher's, minus 1; place of the tip (m,
    m) along the tool's axes. estimate and sd are 0 where a parameter was not fitted. allowance (13,): what a sound
    laboratory has of each.

    gap: median absolute gap that is left, m; cost: its mean, m; push_gaps (pushes,): the median of each push, m,
    signed, push_contacts (pushes,) where it is on the outline, push_samples (pushes,) of how many samples, push_noise
    (pushes,) its standard deviation by the tracker's noise, m. centre (2,): mean place of the tip, m, world frame.
    """

    estimate: Array
    sd: Array
    allowance: Array
    gap: float
    cost: float
    push_gaps: Array
    push_contacts: Array
    push_samples: IntArray
    push_noise: Array
    centre: Array

    @property
    def pushes(self) -> int:
        """Number of contacts."""
        return len(self.push_gaps)

    @property
    def spread(self) -> float:
        """The gap (m) that all pushes but one in five keep below: what the correction leaves unexplained."""
        return float(np.quantile(np.abs(self.push_gaps), MOST_PUSHES))

    @property
    def penalised(self) -> float:
        """The mean gap that other pushes would have, by generalised cross-validation with pushes as observations."""
        spare = self.pushes - np.count_nonzero(self.sd)
        return self.cost * self.pushes / spare if spare > 0 else np.inf

    def shows(self, *parameters: int) -> bool:
        """Whether one of the parameters differs from 0 beyond doubt."""
        each = list(parameters)
        return bool(np.any(np.abs(self.estimate[each]) > DOUBT * self.sd[each] + self.allowance[each]))

    def value(self, parameter: int, unit: str, offset: float = 0.0) -> Value:
        """A parameter, plus an offset, with its standard deviation."""
        return Value(float(self.estimate[parameter]) + offset, unit, float(self.sd[parameter]))

    def off(self, outline: Outline, allowance: float) -> BoolArray:
        """Which pushes (pushes,) have a larger gap (m), by more than the noise of their samples explains.

        Not those at corners, which are rounded, nor short ones: a jump of the slider's pose may look like a contact.
        """
        judged = _away_from_corners(outline, self.push_contacts) >= CORNER
        judged &= self.push_samples >= SHORT * np.median(self.push_samples)
        return np.asarray((np.abs(self.push_gaps) > allowance + NOISY * self.push_noise) & judged)


def fit_outline(contacts: Contacts, rig: Rig) -> OutlineFit:
    """Fit the correction of the rig's outline to the contacts, with the tip's radius as given.

    The size is taken as given too where the contacts do not separate it from a shift: all on one side, for example.
    """
    fit = _fit(contacts, rig, SIMILARITY, _turned_starts)
    return fit if fit.sd[SIZE] < UNKNOWN_SIZE else _fit(contacts, rig, set(SIMILARITY) - {SIZE}, _turned_starts)


def refit(
    first: OutlineFit, contacts: Contacts, rig: Rig, further: Sequence[int], without: int | None = None
) -> OutlineFit:
    """Fit further parameters too, or in place of another. Large sd show what is not separable.

    Frames and tools may be far from where they are meant to be: where the first fit leaves much, they are sought there
    too. With the tip's radius, contacts at corners are dropped: real corners are rounded, and would decide.
    """

    def starts(problem: Problem) -> list[Array]:
        far = _far_corrections(contacts, further if first.spread > DISTURBED else ())
        return [first.estimate, *problem.two_best(far)]

    if TIP in further:
        problem = Problem(contacts, rig, ())
        _, size, nearest = problem.placed(first.estimate)
        sides = size * _away_from_corners(problem.outline, nearest.contact) >= CORNER
        contacts = contacts.at(sides) if sides.any() else contacts
    return _fit(contacts, rig, {*np.flatnonzero(first.sd).tolist(), *further} - {without}, starts)


def _turned_starts(problem: Problem) -> list[Array]:
    """No correction, and the two best of the turns within one period of the symmetry, exact or almost."""
    rows = np.zeros((STARTS, len(WEAK)))
    if not (turns := near_symmetry(problem.outline)):
        return [rows[0]]
    rows[:, YAW] = wrap_angle(np.arange(STARTS) * 2.0 * np.pi / turns / STARTS * turns) / turns
    return [rows[0], *problem.two_best(rows[1:])]


def _far_corrections(contacts: Contacts, further: Sequence[int]) -> Array:
    """Corrections (n, 13) of world frames or tool that bring tip and slider together; none of other parameters."""
    rows = np.zeros((STARTS if FRAME_YAW in further else 1 if TOOL_X in further else 0, len(WEAK)))
    apart = contacts.poses[:, :2] - to_world(contacts.tips, contacts.poses)
    if FRAME_YAW in further:
        rows[:, FRAME_YAW] = wrap_angle(np.arange(STARTS) * 2.0 * np.pi / STARTS)
        rows[:, [FRAME_X, FRAME_Y]] = apart.mean(axis=0)
    elif contacts.tool is not None:
        rows[:, list(TOOL)] = rotate(apart, -contacts.tool).mean(axis=0)
    return rows


def _away_from_corners(outline: Outline, contact: Array) -> Array:
    """Distances (n,) m along the outline from the nearest corner; infinity on a smooth one."""
    if outline.semi_axes is not None:
        return np.full(len(contact), np.inf)
    return np.asarray(np.abs(contact[:, None] - outline.edge_starts).min(axis=1) * outline.perimeter)


def _fit(
    contacts: Contacts, rig: Rig, parameters: Collection[int], starts: Callable[[Problem], Sequence[Array]]
) -> OutlineFit:
    problem = Problem(contacts.drawn(MOST_SAMPLES), rig, parameters)
    estimate = problem.best(starts(problem))
    gaps, nearest, push = problem.gaps(estimate), problem.placed(estimate).nearest, problem.push
    rows = [np.flatnonzero(push == one) for one in np.unique(push)]
    middle = [each[np.argsort(gaps[each])[len(each) // 2]] for each in rows]
    sd, cost, samples = problem.deviation(estimate), problem.cost(estimate), np.array([len(each) for each in rows])
    if turns := problem.outline.rotational_symmetry:
        estimate[YAW] = wrap_angle(np.asarray(estimate[YAW] * turns)) / turns
    return OutlineFit(
        estimate=estimate,
        sd=sd,
        allowance=problem.allowance,
        gap=float(np.median(np.abs(gaps))),
        cost=cost,
        push_gaps=gaps[middle],
        push_contacts=nearest.contact[middle],
        push_samples=samples,
        push_noise=MEDIAN_SD * contacts.noise / np.sqrt(samples),
        centre=problem.centre,
    )


def half_size(rig: Rig) -> float:
    """Distance from the centre to a side, m, of a regular outline with this area and perimeter."""
    return 2.0 * rig.outline.area / rig.outline.perimeter


class Placed(NamedTuple):
    """Tips own (n, 2) m in the frame of the outline as given, which is `size` times as large, and their projection."""

    own: Array
    size: float
    nearest: Projection


class Problem:
    """Gaps (n,) m between the contacts and the corrected outline of a rig, and the fit of some of the parameters.

    A correction and its allowance (13,) are those of OutlineFit. outline: the rig's, with its centroid as the origin: a
    turn about it shifts nothing, so that both are known as well as they can be.
    """

    def __init__(self, contacts: Contacts, rig: Rig, parameters: Collection[int]) -> None:
        self._contacts, self._middle, self._radius = contacts, rig.outline.centroid, rig.pusher_radius
        self.outline = transformed(rig.outline, shift=(-self._middle[0], -self._middle[1]))
        self.push = contacts.push
        self._tool = np.zeros(len(contacts.push)) if contacts.tool is None else contacts.tool
        self._world = to_world(contacts.tips, contacts.poses)
        self.centre = np.asarray(self._world.mean(axis=0))
        extent = float(np.quantile(np.linalg.norm(contacts.poses[:, :2] - self.centre, axis=1), MOST_PUSHES))
        self.allowance = np.full(len(WEAK), LENGTH_ALLOWANCE)
        self.allowance[[YAW, FRAME_YAW]], self.allowance[LAG] = ANGLE_ALLOWANCE, LAG_ALLOWANCE
        self.allowance[[SIZE, STRETCH]] /= half_size(rig)
        self.allowance[SCALE] /= max(extent, LENGTH_ALLOWANCE)
        self._free = np.isin(np.arange(len(WEAK)), list(parameters))
        self._free[YAW] &= self.outline.rotational_symmetry != 0
        self._last: tuple[bytes, Placed] | None = None

    def placed(self, correction: Array) -> Placed:
        """The tips against the corrected outline. The last one is kept: gaps and slopes need it."""
        key = correction.tobytes()
        if self._last is None or self._last[0] != key:
            yaw, x, y, growth, lag, _, *_, stretch, _, _, _ = correction.tolist()
            size = 1.0 + max(growth, SMALLEST)
            tips = self._tips(correction) - self._middle - lag * self._contacts.velocities - [x, y]
            own = rotate(tips, np.array(-yaw)) / size
            self._last = key, Placed(own, size, stretched(self.outline, stretch).project(own))
        return self._last[1]

    def gaps(self, correction: Array) -> Array:
        """Gaps (n,) m between tip and outline, negative inside."""
        placed = self.placed(correction)
        return np.asarray(placed.size * placed.nearest.distance - correction[TIP] - self._radius)

    def slopes(self, correction: Array) -> Array:
        """Derivatives (n, 13) of the gaps by the correction.

        A distance grows along the outward normal; by a change of the outline it falls by what its nearest point moves
        along the normal.
        """
        (own, size, nearest), contacts = self.placed(correction), self._contacts
        normal = rotate(nearest.normal, correction[YAW])  # in the slider's frame
        in_world = rotate(normal, contacts.poses[:, 2])
        slopes = np.empty((len(own), len(correction)))
        slopes[:, YAW] = size * _cross(nearest.normal, own)
        slopes[:, [X, Y]] = -normal
        slopes[:, SIZE] = nearest.distance - _dot(nearest.normal, own) if correction[SIZE] > SMALLEST else 0.0
        slopes[:, LAG] = -_dot(normal, contacts.velocities)
        slopes[:, TIP] = -1.0
        slopes[:, FRAME_YAW] = -_cross(in_world, rotate(self._world - self.centre, correction[FRAME_YAW]))
        slopes[:, [FRAME_X, FRAME_Y]] = in_world
        slopes[:, SCALE] = _dot(in_world, contacts.poses[:, :2] - self.centre)
        slopes[:, list(TOOL)] = rotate(in_world, -self._tool)
        slopes[:, STRETCH] = -size * _dot(nearest.normal, self._moved(nearest.point, float(correction[STRETCH])))
        return slopes

    def cost(self, correction: Array) -> float:
        """The mean gap, m."""
        return float(np.mean(np.minimum(np.abs(self.gaps(correction)), LARGEST)))

    def two_best(self, rows: Array) -> list[Array]:
        """The two of the corrections (n, 13) with the smallest residuals, none of none."""
        return list(rows[np.argsort([float(np.sum(np.abs(self.residuals(row[self._free])))) for row in rows])[:2]])

    def best(self, starts: Sequence[Array]) -> Array:
        """The fit from the first start, unless another leaves a clearly smaller gap; the first has no correction.

        Below the noise of a tracker none is clearly smaller, and the others are not tried.
        """
        found = [self._refined(starts[0])]
        if self.cost(found[0]) <= NOISE:
            return found[0]
        found += map(self._refined, starts[1:])
        costs = list(map(self.cost, found))
        return found[0] if costs[0] <= TIE * min(costs) else found[int(np.argmin(costs))]

    def residuals(self, part: Array) -> Array:
        """Residuals (n + p,) by the free parameters (p,): gaps and parameters in units of their scale."""
        return np.concatenate([self.gaps(self._full(part)) / NOISE, part / WEAK[self._free]])

    def jacobian(self, part: Array) -> Array:
        """Derivatives (n + p, p) of the residuals."""
        slopes = self.slopes(self._full(part))[:, self._free]
        return np.vstack([slopes / NOISE, np.diag(1.0 / WEAK[self._free])])

    def deviation(self, correction: Array) -> Array:
        """Standard deviations (13,) by the sandwich formula with pushes as clusters, from the prior without data."""
        gap, slope, weak = self.gaps(correction), self.slopes(correction)[:, self._free], WEAK[self._free]
        weight = 1.0 / np.sqrt(1.0 + (gap / NOISE) ** 2)
        noise = max(float(np.median(np.abs(gap))) * 1.5, 1e-5)
        bread = np.linalg.inv(slope.T @ (weight[:, None] * slope) + np.diag(noise**2 / weak**2))
        scores = sums_by_push(slope * (weight * gap)[:, None], self.push)
        meat = scores.T @ scores
        few = len(scores) / max(len(scores) - len(weak), 1)
        prior = noise**2 * bread @ np.diag(noise**2 / weak**2) @ bread
        return self._full(np.sqrt(np.diag(few * bread @ meat @ bread) + np.diag(prior)))

    def _refined(self, start: Array) -> Array:
        found = least_squares(
            self.residuals,
            start[self._free],
            jac=self.jacobian,
            loss="soft_l1",
            x_scale="jac",
            ftol=SMALLEST_GAIN,
            max_nfev=MOST_EVALUATIONS,
        )
        return self._full(found.x)

    def _full(self, part: Array) -> Array:
        full = np.zeros(len(WEAK))
        full[self._free] = part
        return full

    def _tips(self, correction: Array) -> Array:
        """The tips in the slider's frame, after what is corrected in the world frame and at the tool.

        A world of the slider that is `scale` too large brings its origin, not its outline, away from the tip.
        """
        yaw, shift, scale = correction[FRAME_YAW], correction[[FRAME_X, FRAME_Y]], correction[SCALE]
        tool = correction[list(TOOL)]
        if yaw == scale == 0.0 and not shift.any() and not tool.any():
            return self._contacts.tips
        turned = self.centre + rotate(self._world - self.centre, yaw) + shift
        away = scale * (self._contacts.poses[:, :2] - self.centre)
        return to_body(turned + away + rotate(tool, self._tool), self._contacts.poses)

    def _moved(self, points: Array, stretch: float) -> Array:
        """Change of points (n, 2) of the stretched outline with the stretch; see shapes.stretched."""
        turn = np.array(0.0 if self.outline.semi_axes is None else self.outline.pose[2])
        share = np.array([0.5 / (1.0 + 0.5 * stretch), -0.5 / (1.0 - 0.5 * stretch)])
        return rotate(share * rotate(points, -turn), turn)


def _dot(one: Array, other: Array) -> Array:
    return np.asarray(one[:, 0] * other[:, 0] + one[:, 1] * other[:, 1])


def _cross(one: Array, other: Array) -> Array:
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
