# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# cython: language_level=3

cdef struct Body:
    # A polygon's edges, or else a smooth curve: an ellipse with a pose, and the table from arc length to its parameter.
    double* edges  # per edge: x, y of its start, x, y along it, square of its length, outward normal, start, share
    Py_ssize_t count  # of edges; 0 for a smooth curve
    double a, b, x, y, cos_turn, sin_turn  # semi-axes and pose
    double perimeter, polar_moment
    double* arc
    double* parameter
    Py_ssize_t last  # index in both

cdef struct Nearest:
    double x, y, normal_x, normal_y, distance  # outward normal; the distance is negative inside
    Py_ssize_t edge
    double share  # of the edge, from its start; or the parameter of a smooth curve
    bint corner  # whether a polygon's corner is nearest

cdef struct Contact:
    double x, y, normal_x, normal_y  # inward normal

cdef Body body_of(double* boundary) noexcept nogil
cdef Nearest nearest_to(double x, double y, Body* body) noexcept nogil
cdef Contact contact_at(double contact, Body* body) noexcept nogil
