# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# cython: language_level=3

from push_predictor.models.mechanics.kernel.surface cimport Acting, Surface

cdef struct Touch:
    double normal_x, normal_y  # inward normal, body frame
    double normal_arm, left_arm  # moments over length of unit forces along the normal and its left
    double along, across  # velocity of the pusher along the normal and its left

cdef struct Start:
    # Where the force lay in the friction cone at the last contact, from 0 at its right edge to 1 at its left, the change
    # of that share over the change of the lag, 0 if unknown, and to how many rad a contact is solved.
    double share, slope, tolerance

cdef struct Driven:
    double x, y, spin  # velocity of the centre of friction, and spin times length
    int slip  # 1 where the pusher slips to the left of the normal, -1 to the right, 0 where it sticks, RESTS without contact

cdef enum:
    RESTS = 2

cdef Driven driven(Touch* touch, double left, double right, Surface* surface, Acting* acting, Start* start) noexcept nogil
