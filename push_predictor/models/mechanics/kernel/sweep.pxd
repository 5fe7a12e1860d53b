# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# cython: language_level=3

from push_predictor.geometry.boundary cimport Body
from push_predictor.models.mechanics.kernel.contact cimport Start
from push_predictor.models.mechanics.kernel.surface cimport Acting, Surface

cdef struct Values:
    # Of the parameters, in the order of parameters.PARAMETERS.
    double contact_friction, friction_difference, friction_by_angle, friction_by_speed, friction_by_load
    double rim_exponent, pressure_spread, centre_x, centre_y, pushing_height, body_anisotropy, body_anisotropy_diagonal
    double tracker_rotation, push_rotation, outline_x, outline_y, radius_error, tip_offset_along, tip_offset_across
    double clock_delay, travel_share
    double grain_x, grain_diagonal, slope_x, slope_y, gradient_x, gradient_y, inertia

cdef struct Push:
    # One push as it was, in the frame of the slider's first pose.
    double tip_x, tip_y, radius, ahead_x, ahead_y  # centre of the disc at the start, its radius, direction of its path
    double travel, speed
    double heading  # of the slider in the world at the start, rad
    Values* values
    Body* body
    Surface* surface
    double centre_x, centre_y, xx, xy, yy  # centre and mean squares of the pressure
    Acting acting  # what acts alike all along the push

cdef struct Pose:
    double x, y, heading

cdef struct Rate:
    Pose motion  # per distance of the path
    double gap  # between disc and slider
    double along  # above 0 where the disc comes closer
    int kind  # of the contact: the same number while the rate is smooth, below 0 at a corner

cdef struct Step:
    Pose pose
    Pose difference  # of the rates of two methods
    bint smooth  # whether all stages have contacts of one kind

cdef struct Tables:
    # Limit surfaces of all pushes of a batch: see LoadMap.
    double* nodes
    double* slopes
    double* quantities
    double power
    Py_ssize_t known, count  # the first ones are of known supports, the others of the patch's exponents in order

cdef struct Common:
    # What all pushes on a slider share.
    Body body
    Tables tables
    double pusher_radius, accuracy

cdef Pose swept(Push* push, double accuracy) noexcept nogil
