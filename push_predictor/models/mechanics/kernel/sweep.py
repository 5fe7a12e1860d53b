# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, nonecheck=False, initializedcheck=False
"""The motion of a slider while a disc sweeps along a straight line, compiled. Types: sweep.pxd.

The motion depends on the path, not on the speed: the travel of the pusher takes the place of time. Steps are of fourth
order. An embedded method estimates the error from the stages of one step, and may miss a kink of the rate between them:
where slip begins or ends, at a corner, where contact is lost. Where all stages have contacts of one kind there is none,
and the estimate holds. Other steps are compared with two of half their length, and so are those that follow, until one
is smooth.
"""

from push_predictor.compiled import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.libc.math import NAN, atan2, cos, fabs, log, sin, sqrt
from cython.cimports.push_predictor.geometry.boundary import Nearest, nearest_to
from cython.cimports.push_predictor.models.mechanics.kernel.contact import RESTS, Driven, Start, Touch, driven
from cython.cimports.push_predictor.models.mechanics.kernel.surface import (
    Acting,
    Root,
    Three,
    answer,
    root_of,
    stretched,
)
from cython.cimports.push_predictor.models.mechanics.kernel.sweep import Pose, Push, Rate, Step, Values

LONGEST_STEP = cython.declare(cython.double, 0.004)  # m: about a pusher's radius, so that no corner is stepped over
TOUCHING = cython.declare(cython.double, 2e-5)  # m: a wider gap at the start of a step is no contact
OF_TRAVEL = cython.declare(cython.double, 0.01)  # of the accuracy: the error of a step allowed for the whole travel
OF_CORNER = cython.declare(cython.double, 0.25)  # of the allowed error: how far the disc may enter
SHORTEST_AT_CORNER = cython.declare(cython.double, 1e-4)  # m: in longer steps
OF_CONTACT = cython.declare(cython.double, 1e-5)  # of the accuracy: to how many rad a contact is solved
MOST_STEPS = cython.declare(cython.int, 20000)  # what takes more is reported as not a number
REFERENCE_SPEED = cython.declare(cython.double, 0.02)  # m/s, at which friction_by_speed is zero
SLOWEST = cython.declare(cython.double, 1e-4)  # m/s, of a tangential speed
BEND_STEP = cython.declare(cython.double, 5e-4)  # m of the path, over which the acceleration of the slider is taken
MOST_INERTIA = cython.declare(cython.double, 0.8)  # of the largest load: more would not be a correction


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def swept(push: cython.pointer(Push), accuracy: cython.double) -> Pose:
    """Pose after the push, from the pose 0, 0, 0. Where the disc does not touch, the slider rests until it does.

    accuracy: of the displacement, relative; a turn counts as its arc at the limit surface's length.
    """
    pose: Pose
    pose.x = pose.y = pose.heading = push.travel - push.travel  # 0, or not a number where the travel is not finite
    done: cython.double = 0.0
    longest: cython.double = _least(push.travel, LONGEST_STEP)
    length: cython.double = push.surface.length
    rough: cython.bint = False
    start: Start
    start.share, start.slope, start.tolerance = 0.5, 0.0, OF_CONTACT * accuracy
    steps: cython.int = 0
    if not push.travel > 0.0:
        return pose
    first: Rate = _rate(pose, done, push, cython.address(start))
    while push.travel - done > 1e-12 * push.travel:
        steps += 1
        if steps > MOST_STEPS:
            pose.x = pose.y = pose.heading = NAN
            return pose
        step: cython.double = _least(longest, push.travel - done)
        apart: cython.bint = first.gap >= TOUCHING
        if apart and first.along > 0.0:
            step = _least(step, first.gap)
        moved: Step = _advance(pose, done, step, first, push, cython.address(start))
        last: Rate = _rate(moved.pose, done + step, push, cython.address(start))
        allowed: cython.double = accuracy * (_distance(moved.pose, pose, length) + OF_TRAVEL * push.travel)
        smooth: cython.bint = apart or (moved.smooth and last.kind == first.kind)
        if rough or not (apart or (smooth and step * _error(moved.difference, last.motion, length) <= allowed)):
            fine: Pose = _in_halves(pose, done, step, first, push, cython.address(start))
            after: Rate = _rate(fine, done + step, push, cython.address(start))
            # Both are wrong alike where only their last stages have seen a corner: the disc enters the slider.
            entered: cython.double = _least(first.gap, 0.0) - after.gap
            deeper: cython.bint = entered > OF_CORNER * allowed and step > SHORTEST_AT_CORNER
            if deeper or _distance(fine, moved.pose, length) > allowed:  # what is not a number goes on, and ends
                longest, rough = 0.5 * step, True
                continue
            moved.pose, last = fine, after
        pose, first = moved.pose, last
        done += step
        longest, rough = _least(2.0 * step, LONGEST_STEP), not smooth
    return pose


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _advance(
    pose: Pose,
    done: cython.double,
    step: cython.double,
    first: Rate,
    push: cython.pointer(Push),
    start: cython.pointer(Start),
) -> Step:
    """One step by Kutta's 3/8 rule (1901) of fourth order, from the rate `first` at its begin.

    difference: the weighted sum of the stages' rates which with that after the step gives the difference from a method
    of third order, also where rates depend on the travel alone. smooth: whether all stages have contacts of one kind.
    """
    found: Step
    found.pose, found.smooth = pose, True
    found.difference.x = found.difference.y = found.difference.heading = 0.0
    if first.gap >= TOUCHING:
        return found
    a: Pose = first.motion
    third: cython.double = step / 3.0
    second: Rate = _rate(_moved(pose, third, a), done + third, push, start)
    b: Pose = second.motion
    at: Pose = _moved(_moved(pose, step, b), -third, a)
    later: Rate = _rate(at, done + 2.0 * third, push, start)
    c: Pose = later.motion
    at = _moved(_moved(_moved(pose, step, a), -step, b), step, c)
    fourth: Rate = _rate(at, done + step, push, start)
    d: Pose = fourth.motion
    part: cython.double = 0.125 * step
    found.pose.x += part * (a.x + 3.0 * (b.x + c.x) + d.x)
    found.pose.y += part * (a.y + 3.0 * (b.y + c.y) + d.y)
    found.pose.heading += part * (a.heading + 3.0 * (b.heading + c.heading) + d.heading)
    found.difference.x = (a.x - 3.0 * (b.x - c.x - d.x)) / 24.0
    found.difference.y = (a.y - 3.0 * (b.y - c.y - d.y)) / 24.0
    found.difference.heading = (a.heading - 3.0 * (b.heading - c.heading - d.heading)) / 24.0
    one_kind: cython.bint = second.kind == first.kind and later.kind == first.kind and fourth.kind == first.kind
    found.smooth = first.kind >= 0 and one_kind
    return found


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _in_halves(
    pose: Pose,
    done: cython.double,
    step: cython.double,
    first: Rate,
    push: cython.pointer(Push),
    start: cython.pointer(Start),
) -> Pose:
    """Pose after a step, in two halves."""
    half: cython.double = 0.5 * step
    middle: Pose = _advance(pose, done, half, first, push, start).pose
    at_half: Rate = _rate(middle, done + half, push, start)
    return _advance(middle, done + half, half, at_half, push, start).pose


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _rate(pose: Pose, done: cython.double, push: cython.pointer(Push), start: cython.pointer(Start)) -> Rate:
    """The rate at a pose and a distance along the path: quasi-static, or with the mass that accelerates."""
    nothing: Three
    nothing.x = nothing.y = nothing.m = 0.0
    found: Rate = _quasi_static(pose, done, push, nothing, start)
    if push.values.inertia == 0.0:
        return found
    ahead: Pose = _moved(pose, BEND_STEP, found.motion)
    later: Rate = _quasi_static(ahead, done + BEND_STEP, push, nothing, start)
    now: Pose = _of_centre(found.motion, pose.heading, push)
    then: Pose = _of_centre(later.motion, ahead.heading, push)
    bend: Pose
    bend.x, bend.y = (then.x - now.x) / BEND_STEP, (then.y - now.y) / BEND_STEP
    bend.heading = (then.heading - now.heading) / BEND_STEP
    return _quasi_static(pose, done, push, _inertial(bend, pose.heading, push), start)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _of_centre(motion: Pose, heading: cython.double, push: cython.pointer(Push)) -> Pose:
    """Rates of the centre of mass: above that of the pressure while the slider rests."""
    found: Pose = motion
    c: cython.double = cos(heading)
    s: cython.double = sin(heading)
    found.x -= motion.heading * (s * push.centre_x + c * push.centre_y)
    found.y += motion.heading * (c * push.centre_x - s * push.centre_y)
    return found


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _inertial(bend: Pose, heading: cython.double, push: cython.pointer(Push)) -> Three:
    """Load of the mass that accelerates (D'Alembert), in units of the largest friction; bend: per metre of the path."""
    load: Three
    c: cython.double = cos(heading)
    s: cython.double = sin(heading)
    load.x, load.y = c * bend.x + s * bend.y, c * bend.y - s * bend.x
    load.m = push.body.polar_moment / push.surface.length * bend.heading
    share: cython.double = push.values.inertia * push.speed * push.speed
    size: cython.double = sqrt(load.x * load.x + load.y * load.y + load.m * load.m) * fabs(share) / MOST_INERTIA
    share = -share / size if size > 1.0 else -share
    load.x, load.y, load.m = share * load.x, share * load.y, share * load.m
    return load


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _quasi_static(
    pose: Pose, done: cython.double, push: cython.pointer(Push), inertial: Three, start: cython.pointer(Start)
) -> Rate:
    """The rate under a further steady load."""
    c: cython.double = cos(pose.heading)
    s: cython.double = sin(pose.heading)
    from_x: cython.double = push.tip_x + done * push.ahead_x - pose.x
    from_y: cython.double = push.tip_y + done * push.ahead_y - pose.y
    nearest: Nearest = nearest_to(c * from_x + s * from_y, c * from_y - s * from_x, push.body)
    length: cython.double = push.surface.length
    centre_x: cython.double = push.centre_x
    centre_y: cython.double = push.centre_y
    values: cython.pointer(Values) = push.values
    world: cython.double = push.heading + pose.heading
    if values.gradient_x != 0.0 or values.gradient_y != 0.0:
        gx: cython.double = cos(world) * values.gradient_x + sin(world) * values.gradient_y
        gy: cython.double = cos(world) * values.gradient_y - sin(world) * values.gradient_x
        centre_x += push.xx * gx + push.xy * gy
        centre_y += push.xy * gx + push.yy * gy
    touch: Touch
    touch.normal_x, touch.normal_y = -nearest.normal_x, -nearest.normal_y
    arm_x: cython.double = (nearest.x - centre_x) / length
    arm_y: cython.double = (nearest.y - centre_y) / length
    touch.normal_arm = arm_x * touch.normal_y - arm_y * touch.normal_x
    touch.left_arm = arm_x * touch.normal_x + arm_y * touch.normal_y
    ahead_x: cython.double = c * push.ahead_x + s * push.ahead_y
    ahead_y: cython.double = c * push.ahead_y - s * push.ahead_x
    touch.along = ahead_x * touch.normal_x + ahead_y * touch.normal_y
    touch.across = ahead_y * touch.normal_x - ahead_x * touch.normal_y
    acting: Acting = _acting(world, push, inertial)
    friction: cython.double = _friction(cython.address(touch), push)
    left: cython.double = _most(friction + values.friction_difference, 0.0)
    right: cython.double = _most(friction - values.friction_difference, 0.0)
    motion: Driven = driven(cython.address(touch), left, right, push.surface, cython.address(acting), start)
    found: Rate
    spin: cython.double = motion.spin / length
    vx: cython.double = motion.x + spin * centre_y
    vy: cython.double = motion.y - spin * centre_x
    found.motion.x, found.motion.y, found.motion.heading = c * vx - s * vy, s * vx + c * vy, spin
    found.gap, found.along = nearest.distance - push.radius, touch.along
    kinds: cython.int = RESTS + 2
    found.kind = -1 if nearest.corner else cython.cast(cython.int, kinds * nearest.edge + motion.slip + 1)
    return found


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _friction(touch: cython.pointer(Touch), push: cython.pointer(Push)) -> cython.double:
    """Coefficient of contact friction, the mean of both sides."""
    values: cython.pointer(Values) = push.values
    friction: cython.double = values.contact_friction
    if values.friction_by_angle != 0.0:
        friction += values.friction_by_angle * fabs(atan2(touch.across, touch.along))
    if values.friction_by_speed != 0.0:
        friction += values.friction_by_speed * log(_most(push.speed * fabs(touch.across), SLOWEST) / REFERENCE_SPEED)
    if values.friction_by_load != 0.0:
        # The normal force is the inverse of the gauge of a unit force along the normal.
        load: Three
        plain: Root
        plain.needed = False
        load.x, load.y, load.m = touch.normal_x, touch.normal_y, touch.normal_arm
        friction -= values.friction_by_load * log(answer(load, push.surface, cython.address(plain)).gauge)
    return friction


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _acting(world: cython.double, push: cython.pointer(Push), inertial: Three) -> Acting:
    """What acts at a heading of the slider in the world, in addition to the pusher."""
    acting: Acting = push.acting
    values: cython.pointer(Values) = push.values
    if values.grain_x != 0.0 or values.grain_diagonal != 0.0:  # only the table's direction depends on the heading
        c: cython.double = cos(2.0 * world)
        s: cython.double = sin(2.0 * world)
        a: cython.double = values.body_anisotropy + c * values.grain_x + s * values.grain_diagonal
        b: cython.double = values.body_anisotropy_diagonal + c * values.grain_diagonal - s * values.grain_x
        acting.root = root_of(a, b, push.surface)
    if acting.pulled:
        pull: Three = inertial
        pull.x += cos(world) * values.slope_x + sin(world) * values.slope_y
        pull.y += cos(world) * values.slope_y - sin(world) * values.slope_x
        acting.pull = stretched(pull, cython.address(acting.root))
        acting.pulled = pull.x != 0.0 or pull.y != 0.0 or pull.m != 0.0
    return acting


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.inline
def _moved(pose: Pose, step: cython.double, rate: Pose) -> Pose:
    found: Pose
    found.x, found.y = pose.x + step * rate.x, pose.y + step * rate.y
    found.heading = pose.heading + step * rate.heading
    return found


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.inline
def _distance(one: Pose, other: Pose, length: cython.double) -> cython.double:
    x: cython.double = one.x - other.x
    y: cython.double = one.y - other.y
    arc: cython.double = (one.heading - other.heading) * length
    return sqrt(x * x + y * y + arc * arc)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.inline
def _error(difference: Pose, last: Pose, length: cython.double) -> cython.double:
    """Size of the difference of rates, with that after the step."""
    x: cython.double = difference.x - last.x / 6.0
    y: cython.double = difference.y - last.y / 6.0
    arc: cython.double = (difference.heading - last.heading / 6.0) * length
    return sqrt(x * x + y * y + arc * arc)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.inline
def _least(one: cython.double, other: cython.double) -> cython.double:
    return other if other < one else one


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.inline
def _most(one: cython.double, other: cython.double) -> cython.double:
    return other if other > one else one
