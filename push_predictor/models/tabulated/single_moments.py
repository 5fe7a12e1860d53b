# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Mean and covariances of one push in plain numbers: the same as `correlation.covariances`, row by row."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt


def moments_in_numbers(
    mean: Sequence[float],
    latent: Sequence[float],
    process: Sequence[float],
    correlation: tuple[float, float, float] | None,
) -> list[float]:
    """3 numbers of the mean, 9 of the outcome's and 9 of the process covariance, row by row.

    latent, process (3): variances of the functions and of the process. correlation: of outputs 1 and 2, 1 and 3, 2 and
    3; None where they are independent.
    """
    (u, v, w), (p, q, r) = latent, process
    a, b, c = u + p, v + q, w + r
    if correlation is None:
        return [*mean, a, 0.0, 0.0, 0.0, b, 0.0, 0.0, 0.0, c, p, 0.0, 0.0, 0.0, q, 0.0, 0.0, 0.0, r]
    r12, r13, r23 = correlation
    pq, pr, qr = r12 * sqrt(p * q), r13 * sqrt(p * r), r23 * sqrt(q * r)
    ab, ac, bc = pq + r12 * sqrt(u * v), pr + r13 * sqrt(u * w), qr + r23 * sqrt(v * w)
    return [*mean, a, ab, ac, ab, b, bc, ac, bc, c, p, pq, pr, pq, q, qr, pr, qr, r]
