# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, nonecheck=False, initializedcheck=False
"""Cubic splines on boxes of up to three axes, and the moments that a table keeps as splines, compiled."""

from push_predictor.compiled import require_compiled

require_compiled(__file__)

import cython
from cython.cimports.libc.math import exp, sqrt, tanh

MOST_FUNCTIONS = 16


def spline_values(
    points: cython.double[:, ::1],
    box: cython.Py_ssize_t[::1],
    low: cython.double[::1],
    per_unit: cython.double[::1],
    cells: cython.Py_ssize_t[::1],
    coefficients: cython.float[:, ::1],
    values: cython.double[:, ::1],
) -> None:
    """Evaluate K <= MOST_FUNCTIONS splines that share D axes, 1 to 3, at points (n, D), each in its box (n,).

    low, per_unit, cells (D,): start of each axis, cells per unit, number of cells. coefficients: (boxes * (cells_1 + 3)
    * ... * (cells_D + 3), K), the last axis fastest. values (n, K) is written.
    """
    axes: cython.Py_ssize_t = points.shape[1]
    count: cython.Py_ssize_t = coefficients.shape[1]
    place: cython.Py_ssize_t[3]
    stride: cython.Py_ssize_t[3]
    weights: cython.double[12]
    sums: cython.float[16]
    whole: cython.Py_ssize_t = 1
    n: cython.Py_ssize_t
    d: cython.Py_ssize_t
    k: cython.Py_ssize_t
    i: cython.Py_ssize_t
    j: cython.Py_ssize_t
    m: cython.Py_ssize_t
    row: cython.Py_ssize_t
    if not (0 < axes <= 3 and count <= MOST_FUNCTIONS):
        raise ValueError(f"{axes} axes and {count} functions: 1 to 3 and at most {MOST_FUNCTIONS} are accepted")
    with cython.nogil:
        for d in range(axes - 1, -1, -1):
            stride[d] = whole
            whole *= cells[d] + 3
        for d in range(axes, 3):  # an axis that does not matter has one knot, of weight 1
            stride[d] = 0
            place[d] = 0
        for n in range(points.shape[0]):
            for d in range(axes):
                at: cython.double = (points[n, d] - low[d]) * per_unit[d]
                cell: cython.Py_ssize_t = cython.cast(cython.Py_ssize_t, at)
                cell = 0 if cell < 0 else (cells[d] - 1 if cell > cells[d] - 1 else cell)
                place[d] = cell
                _weights(at - cell, cython.address(weights[4 * d]))
            for k in range(count):
                sums[k] = 0.0
            first: cython.Py_ssize_t = box[n] * whole
            for i in range(4):
                for j in range(4 if axes > 1 else 1):
                    for m in range(4 if axes > 2 else 1):
                        row = first + (place[0] + i) * stride[0]
                        weight: cython.float = weights[i]
                        if axes > 1:
                            row += (place[1] + j) * stride[1]
                            weight *= cython.cast(cython.float, weights[4 + j])
                        if axes > 2:
                            row += (place[2] + m) * stride[2]
                            weight *= cython.cast(cython.float, weights[8 + m])
                        for k in range(count):
                            sums[k] += weight * coefficients[row, k]
            for k in range(count):
                values[n, k] = sums[k]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
@cython.inline
def _weights(u: cython.double, weights: cython.p_double) -> cython.void:
    """The four cubic B-splines that are not zero at the place u of a cell, 0 to 1."""
    v: cython.double = 1.0 - u
    weights[0] = v * v * v / 6.0
    weights[1] = (4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0
    weights[2] = (4.0 - 6.0 * v * v + 3.0 * v * v * v) / 6.0
    weights[3] = u * u * u / 6.0


def table_moments(
    values: cython.double[:, ::1],
    least: cython.double[::1],
    covariance: cython.double[:, :, ::1],
    process_covariance: cython.double[:, :, ::1],
) -> None:
    """Compute the covariances (n, 3, 3) of outcome and process from the values (n, 9 or 12) of a table.

    Columns 3 to 5: variances of the latent functions, at least `least` (3,); 6 to 8: logarithms of the process
    variances; 9 to 11, if any: the correlation as three numbers, see partial_correlation. The latent functions have the
    correlation of the process; see predictors.correlation.covariances.
    """
    latent: cython.double[3]
    process: cython.double[3]
    n: cython.Py_ssize_t
    i: cython.Py_ssize_t
    j: cython.Py_ssize_t
    coupled: cython.bint = values.shape[1] > 9
    with cython.nogil:
        for n in range(values.shape[0]):
            for i in range(3):
                variance: cython.double = values[n, 3 + i]
                latent[i] = least[i] if variance < least[i] else variance
                process[i] = exp(values[n, 6 + i])
                for j in range(3):
                    covariance[n, i, j] = process_covariance[n, i, j] = 0.0
                covariance[n, i, i], process_covariance[n, i, i] = latent[i] + process[i], process[i]
            if coupled:
                r12: cython.double = tanh(values[n, 9])
                r13: cython.double = tanh(values[n, 10])
                r23: cython.double = r12 * r13 + tanh(values[n, 11]) * sqrt((1.0 - r12 * r12) * (1.0 - r13 * r13))
                for i in range(3):
                    for j in range(i):
                        r: cython.double = r12 if i + j == 1 else (r13 if i + j == 2 else r23)
                        of_process: cython.double = r * sqrt(process[i] * process[j])
                        of_outcome: cython.double = of_process + r * sqrt(latent[i] * latent[j])
                        process_covariance[n, i, j] = process_covariance[n, j, i] = of_process
                        covariance[n, i, j] = covariance[n, j, i] = of_outcome
