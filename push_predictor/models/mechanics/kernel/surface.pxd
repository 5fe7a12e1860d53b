# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# cython: language_level=3

cdef struct Three:  # a load (force x, y, moment over length), or a twist (vx, vy, spin times length)
    double x, y, m

cdef struct Surface:
    # The limit surface of one push: a blend of two tables, or a power law where there is none.
    double* low  # 4 numbers per node of the table
    double* high
    double* slopes_low  # per node, 4 changes by a, then 4 by b, of direction-dependent friction; NULL where there is none
    double* slopes_high
    double* reach_low  # shares of the length by the direction of the arm
    double* reach_high
    double share  # of the table `high`
    double power  # of the power law; 0 for tables
    double length

cdef struct Root:
    # Of W = [[1 + a, b], [b, 1 - a]]: see `root_of`.
    bint needed
    double a, b, xx, xy, yy, turn

cdef struct Acting:
    # What acts on the slider in addition to the pusher, at one instant.
    Root root
    bint pulled
    Three pull  # a load in units of the largest; stretched by the root
    double height  # m

cdef struct Answer:
    Three twist  # up to a positive factor
    double gauge  # size of the load in units of that on the surface in the same direction

cdef Answer answer(Three load, Surface* surface, Root* root) noexcept nogil
cdef Root root_of(double a, double b, Surface* surface) noexcept nogil
cdef Three stretched(Three vector, Root* root) noexcept nogil
cdef Three driven_twist(Three pusher, Surface* surface, Acting* acting) noexcept nogil
