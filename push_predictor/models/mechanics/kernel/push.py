# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, nonecheck=False, initializedcheck=False
"""Displacements of pushes, compiled: from what is recorded to what is true, and back."""

from push_predictor.compiled import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.libc.math import atan2, cos, exp, sin
from cython.cimports.push_predictor.geometry.boundary import Body, Contact, Nearest, body_of, contact_at, nearest_to
from cython.cimports.push_predictor.models.mechanics.kernel.surface import Surface, root_of
from cython.cimports.push_predictor.models.mechanics.kernel.sweep import Common, Pose, Push, Tables, Values, swept

NODES = cython.declare(cython.Py_ssize_t, 145 * 49 * 4)  # numbers of a table
QUANTITIES = cython.declare(cython.Py_ssize_t, 23)
PARAMETERS = cython.declare(cython.int, 28)


@cython.cclass
class Slider:
    """A slider as the kernel takes it: boundary, limit surfaces, pusher and accuracy."""

    common: Common
    _given: object

    def __init__(
        self,
        boundary: cython.double[::1],
        nodes: cython.double[:, :, :, ::1],
        slopes: cython.double[:, :, :, ::1],
        quantities: cython.double[:, ::1],
        power: cython.double,
        pusher_radius: cython.double,
        accuracy: cython.double,
    ) -> None:
        """boundary: see Outline.boundary. pusher_radius m. accuracy: relative.

        nodes (T, 49, 145, 4), slopes (T, 49, 145, 8) or empty where no parameter needs them, quantities (T, 23): see
        SurfaceTables; power: of the power law where there is no table, else 0.
        """
        arrays = boundary.base, nodes.base, slopes.base, quantities.base  # pointers lead into them
        self._given = (*arrays, power, pusher_radius, accuracy)
        self.common.body = body_of(cython.address(boundary[0]))
        self.common.pusher_radius, self.common.accuracy = pusher_radius, accuracy
        tables: cython.pointer(Tables) = cython.address(self.common.tables)
        tables.nodes = cython.address(nodes[0, 0, 0, 0]) if nodes.shape[0] else cython.NULL
        tables.slopes = cython.address(slopes[0, 0, 0, 0]) if slopes.shape[0] else cython.NULL
        tables.quantities, tables.count = cython.address(quantities[0, 0]), quantities.shape[0]
        tables.power, tables.known = power, 0
        exponent: cython.p_double = tables.quantities + QUANTITIES - 1
        while tables.known < tables.count and exponent[0] != exponent[0]:  # a known support has no exponent
            tables.known += 1
            exponent += QUANTITIES

    def __reduce__(self) -> tuple[object, ...]:
        """Of another process: built again from the same arrays."""
        return Slider, self._given


def displacements(
    values: cython.double[:, :, ::1], pushes: cython.double[:, ::1], slider: Slider, found: cython.double[:, :, ::1]
) -> None:
    """Compute displacements (n, k, 3: dx, dy in m, dtheta in rad) of the recorded origin in the recorded push frame.

    values (n, k, 28): k rows of parameters.PARAMETERS for each push, or (1, k, 28) for all pushes. pushes (n, 6):
    velocity m/s, contact, angle rad, duration s, heading of the push in the world rad, number of its known table, -1
    for the patch. found (n, k, 3) is written; what takes too many steps, or is not finite, is not a number.
    """
    own: cython.Py_ssize_t = 1 if values.shape[0] > 1 else 0
    common: cython.pointer(Common) = cython.address(slider.common)
    n: cython.Py_ssize_t
    k: cython.Py_ssize_t
    with cython.nogil:
        for n in range(pushes.shape[0]):
            for k in range(values.shape[1]):
                row: cython.p_double = cython.address(values[n * own, k, 0])
                _displacement(row, cython.address(pushes[n, 0]), common, cython.address(found[n, k, 0]))


def shifts(
    values: cython.double[::1],
    changes: cython.double[:, ::1],
    moved: cython.double[:, ::1],
    pushes: cython.double[:, ::1],
    slider: Slider,
    found: cython.double[:, :, ::1],
) -> None:
    """Compute what changes (n, q) of q parameters shift, and its derivatives by each of them, by central differences.

    values (28,). moved (3, q): number of the parameter, step of its difference, least change of it. found
    (n, 1 + q, 3) is written: the shift, then the derivatives; (n, 1, 3): the shift. The rest as in `displacements`.
    """
    common: cython.pointer(Common) = cython.address(slider.common)
    own: cython.double[28]
    tried: cython.double[3]
    column: cython.Py_ssize_t
    n: cython.Py_ssize_t
    k: cython.Py_ssize_t
    i: cython.Py_ssize_t
    end: cython.int
    unchanged: cython.bint
    with cython.nogil:
        for n in range(pushes.shape[0]):
            push: cython.p_double = cython.address(pushes[n, 0])
            for i in range(PARAMETERS):
                own[i] = values[i]
            unchanged = True
            for k in range(changes.shape[1]):
                unchanged = unchanged and changes[n, k] == 0.0
            for i in range(3):
                found[n, 0, i] = 0.0
            for end in range(0 if unchanged else 2):
                _displacement(own, push, common, tried)
                for i in range(3):
                    found[n, 0, i] = tried[i] - found[n, 0, i] if end else tried[i]
                if end == 0:
                    for k in range(changes.shape[1]):
                        own[cython.cast(cython.Py_ssize_t, moved[0, k])] += changes[n, k]
            for k in range(found.shape[1] - 1):
                column = cython.cast(cython.Py_ssize_t, moved[0, k])
                changed: cython.double = own[column]
                least: cython.double = values[column] + moved[2, k]
                least = changed if changed < least else least
                low: cython.double = changed - moved[1, k]
                low = least if low < least else low
                high: cython.double = changed + moved[1, k]
                for end in range(2):
                    own[column] = high if end else low
                    _displacement(own, push, common, tried)
                    for i in range(3):
                        found[n, 1 + k, i] = (tried[i] - found[n, 1 + k, i]) / (high - low) if end else tried[i]
                own[column] = changed


def drawn_moments(
    found: cython.double[:, :, :],
    paired: cython.Py_ssize_t,
    path: cython.double[:],
    share: cython.double,
    length: cython.double,
    tracked: cython.double[::1],
    factor: cython.double[:, ::1],
    mean: cython.double[:, ::1],
    covariance: cython.double[:, :, ::1],
    noise: cython.double[:, :, ::1],
) -> None:
    """Compute moments of displacements (n, k, 3): the noise of the first 2 paired draws, mean and covariance of others.

    noise (n, 3, 3) is written: the sum of squares of half the differences of draw j and draw paired + j. On the
    diagonal those of a share of the path (n,) in m, of a turn by its arc at the length in m, and of tracked (3,) are
    added. All is multiplied by factor (3, 3). mean (n, 3) and covariance (n, 3, 3), noise included, are written where
    there are other draws.
    """
    draws: cython.Py_ssize_t = found.shape[1]
    n: cython.Py_ssize_t
    i: cython.Py_ssize_t
    j: cython.Py_ssize_t
    k: cython.Py_ssize_t
    total: cython.double
    with cython.nogil:
        for n in range(found.shape[0]):
            for i in range(3):
                far: cython.double = path[n] * share / length if i == 2 else path[n] * share
                for j in range(i + 1):
                    total = far * far + tracked[i] * tracked[i] if i == j else 0.0
                    for k in range(paired):
                        one: cython.double = found[n, k, i] - found[n, paired + k, i]
                        total += 0.25 * one * (found[n, k, j] - found[n, paired + k, j])
                    noise[n, i, j] = noise[n, j, i] = total * factor[i, j]
            if draws == 2 * paired:
                continue
            for i in range(3):
                total = 0.0
                for k in range(2 * paired, draws):
                    total += found[n, k, i]
                mean[n, i] = total / (draws - 2 * paired)
                for j in range(i + 1):
                    total = 0.0
                    for k in range(2 * paired, draws):
                        total += (found[n, k, i] - mean[n, i]) * (found[n, k, j] - mean[n, j])
                    covariance[n, i, j] = covariance[n, j, i] = total / (draws - 2 * paired) + noise[n, i, j]


def propagated(
    slopes: cython.double[:, :, :],
    columns: cython.double[:, :],
    acting: cython.Py_ssize_t[:, ::1],
    covariance: cython.double[:, ::1],
    found: cython.double[:, :, ::1],
) -> None:
    """Compute the covariance (n, 3, 3) of shifts that are linear in m coefficients with covariance (m, m).

    slopes (n, q, 3): derivatives of the shift by q parameters. columns (n, b) of bases. acting (2, m): the parameter
    that each coefficient changes, and the column of which it is the factor.
    """
    count: cython.Py_ssize_t = acting.shape[1]
    n: cython.Py_ssize_t
    i: cython.Py_ssize_t
    j: cython.Py_ssize_t
    k: cython.Py_ssize_t
    m: cython.Py_ssize_t
    with cython.nogil:
        for n in range(slopes.shape[0]):
            for i in range(3):
                for j in range(i + 1):
                    total: cython.double = 0.0
                    for k in range(count):
                        one: cython.double = slopes[n, acting[0, k], i] * columns[n, acting[1, k]]
                        for m in range(count):
                            total += one * covariance[k, m] * slopes[n, acting[0, m], j] * columns[n, acting[1, m]]
                    found[n, i, j] = found[n, j, i] = total


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _displacement(
    row: cython.p_double, given: cython.p_double, common: cython.pointer(Common), found: cython.p_double
) -> cython.void:
    """One row of `displacements`."""
    values: cython.pointer(Values) = cython.cast(cython.pointer(Values), row)
    body: cython.pointer(Body) = cython.address(common.body)
    pusher_radius: cython.double = common.pusher_radius
    velocity: cython.double = given[0]
    contact: Contact = contact_at(given[1], body)
    c: cython.double = cos(given[2])
    s: cython.double = sin(given[2])
    recorded_x: cython.double = c * contact.normal_x - s * contact.normal_y
    recorded_y: cython.double = s * contact.normal_x + c * contact.normal_y
    push: Push
    push.values, push.body = values, body
    surface: Surface = _surface(cython.address(common.tables), given[5], cython.address(push))
    push.surface = cython.address(surface)
    push.radius = pusher_radius + values.radius_error
    along: cython.double = values.tip_offset_along + velocity * values.clock_delay
    across: cython.double = values.tip_offset_across
    x: cython.double = contact.x - pusher_radius * contact.normal_x + along * recorded_x - across * recorded_y
    y: cython.double = contact.y - pusher_radius * contact.normal_y + along * recorded_y + across * recorded_x
    c, s = cos(values.tracker_rotation), sin(values.tracker_rotation)
    shift_x: cython.double = values.outline_x
    shift_y: cython.double = values.outline_y
    push.tip_x, push.tip_y = c * (x - shift_x) + s * (y - shift_y), c * (y - shift_y) - s * (x - shift_x)
    if along != 0.0 or across != 0.0 or shift_x != 0.0 or shift_y != 0.0 or s != 0.0 or values.radius_error != 0.0:
        # A window begins in contact: the tip is moved along the outline's normal until it touches.
        nearest: Nearest = nearest_to(push.tip_x, push.tip_y, body)
        push.tip_x = nearest.x + push.radius * nearest.normal_x
        push.tip_y = nearest.y + push.radius * nearest.normal_y
    origin_x: cython.double = -c * shift_x - s * shift_y  # of the recorded body frame
    origin_y: cython.double = s * shift_x - c * shift_y
    recorded_x, recorded_y = c * recorded_x + s * recorded_y, c * recorded_y - s * recorded_x
    c, s = cos(values.push_rotation), sin(values.push_rotation)
    push.ahead_x, push.ahead_y = c * recorded_x - s * recorded_y, s * recorded_x + c * recorded_y
    push.speed = velocity * (1.0 + values.travel_share)
    push.travel = push.speed * given[3] + (given[1] - given[1])  # not finite where the contact is not
    push.heading = given[4] - atan2(recorded_y, recorded_x)
    pose: Pose = swept(cython.address(push), common.accuracy)
    c, s = cos(pose.heading), sin(pose.heading)
    pose.x += c * origin_x - s * origin_y - origin_x
    pose.y += s * origin_x + c * origin_y - origin_y
    found[0] = recorded_x * pose.x + recorded_y * pose.y
    found[1] = recorded_x * pose.y - recorded_y * pose.x
    found[2] = pose.heading


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _surface(tables: cython.pointer(Tables), number: cython.double, push: cython.pointer(Push)) -> Surface:
    """The surface of a push; what of it acts alike all along the push is written into the push."""
    values: cython.pointer(Values) = push.values
    low: cython.Py_ssize_t = cython.cast(cython.Py_ssize_t, number)
    surface: Surface
    surface.power, surface.share = tables.power, 0.0
    if number < 0.0:  # between the patches whose exponents are next to that of the push
        exponent: cython.double = values.rim_exponent
        low = tables.known
        while low < tables.count - 2 and exponent >= tables.quantities[QUANTITIES * (low + 2) - 1]:
            low += 1
        if tables.count > low + 1:
            below: cython.double = tables.quantities[QUANTITIES * (low + 1) - 1]
            share: cython.double = (exponent - below) / (tables.quantities[QUANTITIES * (low + 2) - 1] - below)
            surface.share = 0.0 if share < 0.0 else (1.0 if share > 1.0 else share)
    blend: cython.double = surface.share
    one: cython.p_double = tables.quantities + QUANTITIES * low
    other: cython.p_double = one + QUANTITIES if blend > 0.0 else one
    spread: cython.double = exp(values.pressure_spread)  # about the centre: the surface keeps its shape
    surface.length = (one[2] + blend * (other[2] - one[2])) * spread
    surface.reach_low, surface.reach_high = one + 6, other + 6
    surface.low = surface.high = surface.slopes_low = surface.slopes_high = cython.NULL
    if tables.nodes != cython.NULL:
        surface.low = surface.high = tables.nodes + NODES * low
        if blend > 0.0:
            surface.high = surface.low + NODES
    if tables.slopes != cython.NULL:
        surface.slopes_low = surface.slopes_high = tables.slopes + 2 * NODES * low
        if blend > 0.0:
            surface.slopes_high = surface.slopes_low + 2 * NODES
    push.centre_x = one[0] + blend * (other[0] - one[0]) + values.centre_x
    push.centre_y = one[1] + blend * (other[1] - one[1]) + values.centre_y
    square: cython.double = spread * spread
    push.xx = (one[3] + blend * (other[3] - one[3])) * square
    push.xy = (one[4] + blend * (other[4] - one[4])) * square
    push.yy = (one[5] + blend * (other[5] - one[5])) * square
    push.acting.root.needed = False
    if values.body_anisotropy != 0.0 or values.body_anisotropy_diagonal != 0.0:
        push.acting.root = root_of(values.body_anisotropy, values.body_anisotropy_diagonal, cython.address(surface))
    push.acting.pulled = values.slope_x != 0.0 or values.slope_y != 0.0 or values.inertia != 0.0
    push.acting.height = values.pushing_height
    return surface
