# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One push, integrated: the compiled mechanics.

`push.displacements` is the way in. A part a file: surface (limit surface), contact (sticking or sliding), sweep (rates
and steps), push (from what is recorded to what is true, and back). The nearest point of an outline is in
geometry/boundary.
"""
