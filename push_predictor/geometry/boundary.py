# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, nonecheck=False, initializedcheck=False
"""The boundary of a slider, compiled: nearest points, and the point of a contact. The types are in boundary.pxd."""

from push_predictor.compiled import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.libc.math import M_PI, atan2, copysign, cos, fabs, sin, sqrt
from cython.cimports.push_predictor.geometry.boundary import Body, Contact, Nearest

NEWTON_STEPS = cython.declare(cython.int, 60)  # enough for bisection alone
PARAMETER_TOLERANCE = cython.declare(cython.double, 1e-14)  # rad
# m; a point this near to a corner has the normal of an edge, not the direction of a rounding error
ROUNDING = cython.declare(cython.double, 1e-12)


def project(points: cython.double[:, ::1], boundary: cython.double[::1], found: cython.double[:, ::1]) -> None:
    """Find the nearest boundary points of points (n, 2) in m, body frame.

    boundary: see Outline.boundary. found (n, 8) is written: x, y of the nearest point, outward normal x, y, signed
    distance (negative inside), edge, share of the edge (or the parameter of a smooth curve), and 1 where a corner is
    nearest.
    """
    body: Body = body_of(cython.address(boundary[0]))
    nearest: Nearest
    k: cython.Py_ssize_t
    with cython.nogil:
        for k in range(points.shape[0]):
            nearest = nearest_to(points[k, 0], points[k, 1], cython.address(body))
            found[k, 0], found[k, 1] = nearest.x, nearest.y
            found[k, 2], found[k, 3] = nearest.normal_x, nearest.normal_y
            found[k, 4], found[k, 5] = nearest.distance, nearest.edge
            found[k, 6], found[k, 7] = nearest.share, nearest.corner


def place_features(
    inputs: cython.double[:, ::1],
    boundary: cython.double[::1],
    order: cython.Py_ssize_t,
    spacing: cython.double,
    found: cython.double[:, ::1],
) -> None:
    """Compute features of pushes (n, 3: velocity, contact, angle) that fold an outline's rotational symmetry.

    order: of the symmetry, 0 for a circle. spacing: distance between edges that no symmetry maps onto each other.
    found (n, D) is written: the velocity, the place of the contact (none on a circle; cosine and sine on a smooth
    curve; on a polygon the fraction of the edge), the angle.
    """
    body: Body = body_of(cython.address(boundary[0]))
    last: cython.Py_ssize_t = found.shape[1] - 1
    n: cython.Py_ssize_t
    with cython.nogil:
        for n in range(inputs.shape[0]):
            found[n, 0], found[n, last] = inputs[n, 0], inputs[n, 2]
            contact: cython.double = inputs[n, 1]
            if body.count > 0:
                edge: cython.Py_ssize_t = _edge_at(contact, cython.address(body))
                share: cython.double = (contact - body.edges[9 * edge + 7]) / body.edges[9 * edge + 8]
                share = 0.0 if share < 0.0 else (1.0 if share > 1.0 else share)
                found[n, 1] = spacing * (edge % (body.count // order)) + share
            elif order > 0:
                found[n, 1], found[n, 2] = cos(2.0 * M_PI * order * contact), sin(2.0 * M_PI * order * contact)


def within_box(
    points: cython.double[:, :], low: cython.double[::1], high: cython.double[::1], found: cython.uchar[::1]
) -> None:
    """Find which of the points (n, D) lie in the box from low (D,) to high (D,), ends included; found (n,)."""
    n: cython.Py_ssize_t
    k: cython.Py_ssize_t
    with cython.nogil:
        for n in range(points.shape[0]):
            found[n] = True
            for k in range(points.shape[1]):
                found[n] = found[n] and points[n, k] >= low[k] and points[n, k] <= high[k]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def body_of(boundary: cython.p_double) -> Body:
    """Outline.boundary as the functions below take it; the array must outlive it."""
    body: Body
    body.count, body.last = cython.cast(cython.Py_ssize_t, boundary[0]), cython.cast(cython.Py_ssize_t, boundary[1]) - 1
    body.a, body.b, body.x, body.y = boundary[2], boundary[3], boundary[4], boundary[5]
    body.cos_turn, body.sin_turn = cos(boundary[6]), sin(boundary[6])
    body.polar_moment = boundary[7]
    body.edges = boundary + 8
    body.arc = body.edges + 9 * body.count
    body.parameter = body.arc + body.last + 1
    body.perimeter = body.arc[body.last] if body.last > 0 else 0.0
    return body


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def nearest_to(x: cython.double, y: cython.double, body: cython.pointer(Body)) -> Nearest:
    """The boundary point nearest to x, y."""
    if body.count > 0:
        return _on_polygon(x, y, body)
    return _on_ellipse(x, y, body)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _on_polygon(x: cython.double, y: cython.double, body: cython.pointer(Body)) -> Nearest:
    """Of the nearest points of all edges, the nearest; a ray to the right of the point counts the edges it crosses."""
    found: Nearest
    edge: cython.p_double
    least: cython.double = 1e300
    inside: cython.bint = False
    away_x: cython.double = 0.0
    away_y: cython.double = 0.0
    k: cython.Py_ssize_t
    found.edge = 0
    found.share = 0.0
    for k in range(body.count):
        edge = body.edges + 9 * k
        from_x: cython.double = x - edge[0]
        from_y: cython.double = y - edge[1]
        share: cython.double = (from_x * edge[2] + from_y * edge[3]) / edge[4]
        share = 0.0 if share < 0.0 else (1.0 if share > 1.0 else share)
        off_x: cython.double = from_x - share * edge[2]
        off_y: cython.double = from_y - share * edge[3]
        square: cython.double = off_x * off_x + off_y * off_y
        if square < least:
            least, away_x, away_y = square, off_x, off_y
            found.edge, found.share = k, share
        end_y: cython.double = body.edges[9 * (k + 1 if k + 1 < body.count else 0) + 1]  # bits of the next start
        if (y < edge[1]) != (y < end_y) and from_x < from_y * edge[2] / edge[3]:
            inside = not inside
    edge = body.edges + 9 * found.edge
    length: cython.double = sqrt(least)
    found.x, found.y, found.normal_x, found.normal_y = x - away_x, y - away_y, edge[5], edge[6]
    found.distance = -length if inside else length
    found.corner = not inside and length > ROUNDING and not (found.share > 0.0 and found.share < 1.0)
    if found.corner:
        found.normal_x, found.normal_y = away_x / length, away_y / length
    if least >= 1e300:  # a point that is not finite has no nearest one
        found.x = found.y = found.normal_x = found.normal_y = found.distance = (x - x) + (y - y)
    return found


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _on_ellipse(x: cython.double, y: cython.double, body: cython.pointer(Body)) -> Nearest:
    found: Nearest
    c: cython.double = body.cos_turn
    s: cython.double = body.sin_turn
    u: cython.double = c * (x - body.x) + s * (y - body.y)
    v: cython.double = c * (y - body.y) - s * (x - body.x)
    t: cython.double = _parameter(body.a, body.b, fabs(u), fabs(v))
    cos_t: cython.double = copysign(cos(t), u)
    sin_t: cython.double = copysign(sin(t), v)
    point_x: cython.double = body.a * cos_t
    point_y: cython.double = body.b * sin_t
    normal_x: cython.double = body.b * cos_t
    normal_y: cython.double = body.a * sin_t
    size: cython.double = sqrt(normal_x * normal_x + normal_y * normal_y)
    normal_x, normal_y = normal_x / size, normal_y / size
    found.distance = (u - point_x) * normal_x + (v - point_y) * normal_y
    found.x, found.y = body.x + c * point_x - s * point_y, body.y + s * point_x + c * point_y
    found.normal_x, found.normal_y = c * normal_x - s * normal_y, s * normal_x + c * normal_y
    found.edge, found.share, found.corner = 0, atan2(sin_t, cos_t), False
    return found


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _parameter(a: cython.double, b: cython.double, x: cython.double, y: cython.double) -> cython.double:
    """Parameter of the curve point nearest to x, y >= 0, by Newton's method safeguarded by bisection.

    In the first quadrant the slope of the squared distance has a single root.
    """
    t: cython.double = atan2(a * y, b * x)
    low: cython.double = 0.0
    high: cython.double = 0.5 * M_PI
    skew: cython.double = b * b - a * a
    _k: cython.int
    for _k in range(NEWTON_STEPS):
        c: cython.double = cos(t)
        s: cython.double = sin(t)
        slope: cython.double = skew * c * s + x * a * s - y * b * c
        bend: cython.double = skew * (c * c - s * s) + x * a * c + y * b * s
        if slope > 0.0:
            high = t
        else:
            low = t
        before: cython.double = t
        if bend > 0.0:
            t -= slope / bend
        if not (bend > 0.0 and low <= t and t <= high):
            t = 0.5 * (low + high)
        if fabs(t - before) < PARAMETER_TOLERANCE:
            break
    return t


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def contact_at(contact: cython.double, body: cython.pointer(Body)) -> Contact:
    """Point and inward normal at a fraction of the perimeter."""
    if body.count > 0:
        return _contact_on_polygon(contact, body)
    return _contact_on_ellipse(contact, body)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _edge_at(contact: cython.double, body: cython.pointer(Body)) -> cython.Py_ssize_t:
    edge: cython.Py_ssize_t = body.count - 1
    while edge > 0 and contact < body.edges[9 * edge + 7]:
        edge -= 1
    return edge


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _contact_on_polygon(contact: cython.double, body: cython.pointer(Body)) -> Contact:
    found: Contact
    edge: cython.p_double
    edge = body.edges + 9 * _edge_at(contact, body)
    share: cython.double = (contact - edge[7]) / edge[8]
    share = 0.0 if share < 0.0 else (1.0 if share > 1.0 else share)
    found.x, found.y = edge[0] + share * edge[2], edge[1] + share * edge[3]
    found.normal_x, found.normal_y = -edge[5], -edge[6]
    return found


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _contact_on_ellipse(contact: cython.double, body: cython.pointer(Body)) -> Contact:
    found: Contact
    place: cython.double = contact * body.perimeter
    low: cython.Py_ssize_t = 0
    high: cython.Py_ssize_t = body.last
    while high - low > 1:
        middle: cython.Py_ssize_t = (low + high) // 2
        if body.arc[middle] <= place:
            low = middle
        else:
            high = middle
    share: cython.double = (place - body.arc[low]) / (body.arc[high] - body.arc[low])
    share = 0.0 if share < 0.0 else (1.0 if share > 1.0 else share)
    t: cython.double = body.parameter[low] + share * (body.parameter[high] - body.parameter[low])
    c: cython.double = cos(t)
    s: cython.double = sin(t)
    size: cython.double = sqrt(body.b * c * body.b * c + body.a * s * body.a * s)
    x: cython.double = body.a * c
    y: cython.double = body.b * s
    normal_x: cython.double = -body.b * c / size
    normal_y: cython.double = -body.a * s / size
    found.x = body.x + body.cos_turn * x - body.sin_turn * y
    found.y = body.y + body.sin_turn * x + body.cos_turn * y
    found.normal_x = body.cos_turn * normal_x - body.sin_turn * normal_y
    found.normal_y = body.sin_turn * normal_x + body.cos_turn * normal_y
    return found
