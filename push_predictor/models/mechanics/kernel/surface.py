# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, nonecheck=False, initializedcheck=False
"""The limit surface of one push, compiled: from the pusher's load to the twist that it drives. Types: surface.pxd.

A table has a cell for each azimuth of the force and elevation of the moment (see load_map). A load with a negative
moment has the opposite twist of its opposite.

Direction-dependent friction: a point at velocity u resists with W^-1 u over the root of u' W^-1 u, with
W = [[1 + a, b], [b, 1 - a]]. With its root R, isotropic friction resists at the velocity R^-1 u, and the load f becomes
R f. A body whose points have the arms r is then one with the arms R r / det R under the same moments.
"""

from push_predictor.compiled import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.libc.math import M_PI, atan2, cos, fabs, pow, sin, sqrt
from cython.cimports.push_predictor.models.mechanics.kernel.surface import Acting, Answer, Root, Surface, Three

AZIMUTHS = cython.declare(cython.int, 144)  # as in load_map, which a test compares
ELEVATIONS = cython.declare(cython.int, 49)
DIRECTIONS = cython.declare(cython.int, 16)  # of arms, over half a turn
MOST_STRETCH = cython.declare(cython.double, 0.95)  # of (a, b): at 1 the friction along one direction is infinite
PULL_ROUNDS = cython.declare(cython.int, 4)  # the first is exact on an ellipsoid
SMALLEST_MARGIN = cython.declare(cython.double, 1e-6)  # of a pull to the friction that it cannot overcome alone
TINY = cython.declare(cython.double, 1e-300)

COS = cython.declare(cython.double[16])  # of twice the direction of an arm
SIN = cython.declare(cython.double[16])
for _k in range(16):
    COS[_k] = cos(2.0 * M_PI * _k / 16.0)
    SIN[_k] = sin(2.0 * M_PI * _k / 16.0)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def answer(load: Three, surface: cython.pointer(Surface), root: cython.pointer(Root)) -> Answer:
    """Twist and gauge of a load, on a surface whose shape the root changes."""
    if surface.power > 0.0:
        return _of_power(load, surface.power)
    sign: cython.double = -1.0 if load.m < 0.0 else 1.0
    x: cython.double = sign * load.x
    y: cython.double = sign * load.y
    m: cython.double = sign * load.m
    square: cython.double = x * x + y * y
    turn: cython.double = atan2(y, x) * (AZIMUTHS / (2.0 * M_PI))
    rise: cython.double = atan2(m, sqrt(square)) * ((ELEVATIONS - 1) / (0.5 * M_PI))
    if turn < 0.0:
        turn += AZIMUTHS
    column: cython.int = cython.cast(cython.int, turn)
    row: cython.int = cython.cast(cython.int, rise)
    # What is not a number has no cell: any, since the answer is no number either.
    column = 0 if column < 0 else (AZIMUTHS - 1 if column > AZIMUTHS - 1 else column)
    row = 0 if row < 0 else (ELEVATIONS - 2 if row > ELEVATIONS - 2 else row)
    place: cython.Py_ssize_t = row * (AZIMUTHS + 1) + column
    right: cython.double = turn - column
    up: cython.double = rise - row
    size: cython.double = sqrt(square + m * m)
    found: Answer = _of_cell(surface.low, surface.slopes_low, place, root, right, up)
    found.gauge = size / found.gauge
    if surface.share > 0.0:
        other: Answer = _of_cell(surface.high, surface.slopes_high, place, root, right, up)
        found.twist.x += surface.share * (other.twist.x - found.twist.x)
        found.twist.y += surface.share * (other.twist.y - found.twist.y)
        found.twist.m += surface.share * (other.twist.m - found.twist.m)
        found.gauge += surface.share * (size / other.gauge - found.gauge)
    found.twist.x *= sign * size
    found.twist.y *= sign * size
    found.twist.m *= sign * size
    return found


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.inline
def _of_cell(
    nodes: cython.p_double,
    slopes: cython.p_double,
    place: cython.Py_ssize_t,
    root: cython.pointer(Root),
    right: cython.double,
    up: cython.double,
) -> Answer:
    """Unit twist, and in place of the gauge the size of the load on the surface, in the cell above a node."""
    found: Answer
    part: cython.double[4]
    k: cython.Py_ssize_t
    for k in range(4):
        part[k] = _between(nodes + 4 * place + k, 4, right, up)
    if root.needed and slopes != cython.NULL:
        for k in range(4):
            by_a: cython.double = _between(slopes + 8 * place + k, 8, right, up)
            part[k] += root.a * by_a + root.b * _between(slopes + 8 * place + 4 + k, 8, right, up)
    found.twist.x, found.twist.y, found.twist.m, found.gauge = part[0], part[1], part[2], part[3]
    return found


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.inline
def _between(node: cython.p_double, size: cython.Py_ssize_t, right: cython.double, up: cython.double) -> cython.double:
    """A number of the nodes, `size` of each, interpolated between four of them."""
    above: cython.p_double = node + size * (AZIMUTHS + 1)
    across: cython.double = node[size] - node[0]
    both: cython.double = above[size] - above[0] - across
    return node[0] + right * across + up * (above[0] - node[0]) + right * up * both


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _of_power(load: Three, power: cython.double) -> Answer:
    """On the surface (f / fmax)^p + (m / mmax)^p = 1; p = 2 is the ellipsoid of Lynch et al. (1992)."""
    found: Answer
    force: cython.double = sqrt(load.x * load.x + load.y * load.y)
    size: cython.double = sqrt(force * force + load.m * load.m)
    if power == 2.0:
        found.twist, found.gauge = load, size
        return found
    force = force if not force < TINY else TINY
    scale: cython.double = pow(force / size, power - 2.0)
    spin: cython.double = pow(fabs(load.m / size), power - 1.0) * size  # the twist is linear in the size of the load
    found.twist.x, found.twist.y = scale * load.x, scale * load.y
    found.twist.m = spin if load.m > 0.0 else -spin
    found.gauge = pow(pow(force, power) + pow(fabs(load.m), power), 1.0 / power)
    return found


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def root_of(a: cython.double, b: cython.double, surface: cython.pointer(Surface)) -> Root:
    """The root R for a stretch (a, b), at most MOST_STRETCH long; turn: by how much less the arms grow, as a factor."""
    root: Root
    length: cython.double = sqrt(a * a + b * b)
    if length > MOST_STRETCH:
        a, b = a * MOST_STRETCH / length, b * MOST_STRETCH / length
    determinant: cython.double = sqrt(1.0 - a * a - b * b)
    trace: cython.double = sqrt(2.0 + 2.0 * determinant)
    arms: cython.double = 0.0
    k: cython.int
    for k in range(DIRECTIONS):
        reach: cython.double = surface.reach_low[k]
        reach += surface.share * (surface.reach_high[k] - reach)
        arms += reach * sqrt(1.0 + a * COS[k] + b * SIN[k])
    root.needed, root.a, root.b, root.turn = True, a, b, determinant / arms
    root.xx, root.xy, root.yy = (1.0 + a + determinant) / trace, b / trace, (1.0 - a + determinant) / trace
    return root


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.inline
def stretched(vector: Three, root: cython.pointer(Root)) -> Three:
    """R times a force or velocity; the moment or spin in units of the stretched arms."""
    if not root.needed:
        return vector
    found: Three
    found.x = root.xx * vector.x + root.xy * vector.y
    found.y = root.xy * vector.x + root.yy * vector.y
    found.m = root.turn * vector.m
    return found


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def driven_twist(pusher: Three, surface: cython.pointer(Surface), acting: cython.pointer(Acting)) -> Three:
    """Twist of the centre of friction up to a positive factor, from the pusher's load and what else acts.

    A push at a height moves the centre of pressure along the pusher's force, in proportion to it.
    """
    load: Three = stretched(pusher, cython.address(acting.root))
    factor: cython.double = 0.0  # that brings the pusher's load onto the surface
    found: Answer
    if acting.pulled:
        found = _with_pull(load, surface, acting, cython.address(factor))
    else:
        found = answer(load, surface, cython.address(acting.root))
    twist: Three = stretched(found.twist, cython.address(acting.root))
    if acting.height != 0.0:
        if not acting.pulled:
            factor = 1.0 / found.gauge
        shift: cython.double = acting.height * factor * twist.m / surface.length
        twist.x += shift * pusher.y
        twist.y -= shift * pusher.x
    return twist


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _with_pull(
    load: Three, surface: cython.pointer(Surface), acting: cython.pointer(Acting), factor: cython.p_double
) -> Answer:
    """Answer of a pusher's load with a pull, both together on the surface, in the size of the load; sets its factor."""
    pull: Three = acting.pull
    given: cython.double = sqrt(load.x * load.x + load.y * load.y + load.m * load.m)
    x: cython.double = load.x / given
    y: cython.double = load.y / given
    m: cython.double = load.m / given
    dot: cython.double = x * pull.x + y * pull.y + m * pull.m
    square: cython.double = pull.x * pull.x + pull.y * pull.y + pull.m * pull.m
    radius: cython.double = 1.0
    share: cython.double = 1.0
    on: Three
    found: Answer
    found.twist, found.gauge = load, 1.0
    _k: cython.int
    for _k in range(PULL_ROUNDS):
        margin: cython.double = dot * dot + radius * radius - square
        share = -dot + sqrt(margin if not margin < SMALLEST_MARGIN else SMALLEST_MARGIN)
        on.x, on.y, on.m = share * x + pull.x, share * y + pull.y, share * m + pull.m
        found = answer(on, surface, cython.address(acting.root))
        radius = sqrt(on.x * on.x + on.y * on.y + on.m * on.m) / found.gauge
    factor[0] = share / given
    found.twist.x *= given
    found.twist.y *= given
    found.twist.m *= given
    return found
