# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, nonecheck=False, initializedcheck=False
"""The twist of a slider under a pusher that touches it, compiled: sticking or sliding. Types: contact.pxd.

The limit surface is convex, so the direction of the contact's velocity turns with that of the force: at the edges of
the friction cone it shows whether the contact slips, and between them lies the force of a contact that sticks.
"""

from push_predictor.compiled import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.libc.math import fabs, sqrt
from cython.cimports.push_predictor.models.mechanics.kernel.contact import RESTS, Driven, Start, Touch
from cython.cimports.push_predictor.models.mechanics.kernel.surface import Acting, Surface, Three, driven_twist

ROOT_STEPS = cython.declare(cython.int, 40)
BISECT_EVERY = cython.declare(cython.int, 6)  # steps: next to a flat or an edge of the surface, secants converge slowly


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def driven(
    touch: cython.pointer(Touch),
    left: cython.double,
    right: cython.double,
    surface: cython.pointer(Surface),
    acting: cython.pointer(Acting),
    start: cython.pointer(Start),
) -> Driven:
    """The motion under coefficients of friction for slip to the left and to the right.

    A pusher that does not approach leaves the slider at rest. The root is found by secants within a bracket, from
    `start`, which then has that of this contact.
    """
    found: Driven
    found.x = found.y = found.spin = 0.0
    found.slip = RESTS
    if touch.along <= 0.0:
        return found
    a: cython.double = 1.0 / sqrt(1.0 + right * right)
    b: cython.double = 1.0 / sqrt(1.0 + left * left)
    load: Three
    twist: Three
    low: cython.double = 0.0
    high: cython.double = 1.0
    known_low: cython.bint = False
    known_high: cython.bint = False
    share: cython.double = start.share
    before: cython.double = -1.0
    lag_before: cython.double = 0.0
    toward: cython.double = 0.0
    step: cython.int
    twist.x = twist.y = twist.m = 0.0
    for step in range(1, ROOT_STEPS + 1):
        push: cython.double = a + share * (b - a)
        rub: cython.double = -right * a + share * (left * b + right * a)
        load.x = push * touch.normal_x - rub * touch.normal_y
        load.y = push * touch.normal_y + rub * touch.normal_x
        load.m = push * touch.normal_arm + rub * touch.left_arm
        twist = driven_twist(load, surface, acting)
        toward = twist.x * touch.normal_x + twist.y * touch.normal_y + twist.m * touch.normal_arm
        sideways: cython.double = twist.y * touch.normal_x - twist.x * touch.normal_y + twist.m * touch.left_arm
        # Above 0 where the force must turn to the left, for the contact to move as the pusher does. The velocity is
        # within a right angle of the force, so one away from the pusher lies beyond the normal's left or right.
        lag: cython.double = (toward if toward > 0.0 else 0.0) * touch.across - sideways * touch.along
        if fabs(lag) <= start.tolerance * toward or high - low <= start.tolerance:
            break
        if (share == 1.0 and lag > 0.0) or (share == 0.0 and lag < 0.0):
            break
        if lag > 0.0:
            low, known_low = share, True
        else:
            high, known_high = share, True
        if before >= 0.0 and lag != lag_before:
            start.slope = (share - before) / (lag - lag_before)
        before, lag_before = share, lag
        if start.slope < 0.0:
            share -= lag * start.slope
        else:
            share += 1.0 if lag > 0.0 else -1.0
        if share >= high and not known_high:
            share = 1.0
        elif share <= low and not known_low:
            share = 0.0
        elif not (low < share and share < high) or step % BISECT_EVERY == 0:
            share = 0.5 * (low + high)
    start.share = share
    if toward <= 0.0:
        return found
    size: cython.double = touch.along / toward
    found.x, found.y, found.spin = twist.x * size, twist.y * size, twist.m * size
    found.slip = 1 if share == 1.0 else (-1 if share == 0.0 else 0)
    return found
