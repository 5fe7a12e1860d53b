# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Greedy selection: each push is the one that most reduces what is left of the loss when those before it are known."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from push_predictor.design.information import Information
from push_predictor.types import Array, IntArray
from push_predictor.watch import Watch, no_watch, watched


def greedy(
    information: Information,
    count: int,
    given: Sequence[int | None] = (),
    factor: Callable[[Sequence[int]], Array] | None = None,
    check_cancelled: Callable[[], None] | None = None,
    watch: Watch = no_watch,
) -> tuple[IntArray, Array]:
    """Candidates (count,) in the order chosen, and the mean variance (count,) of what matters after each.

    given: candidates that are taken in their place, None where one is chosen; those after its end are chosen. factor:
    by how much the gain of each candidate (c,) counts after those chosen so far, 1 without it. check_cancelled is
    called before each choice and may raise, watch with the share of the choices made.
    """
    order: list[int] = []
    variances = np.empty(count)
    for k in watched(range(count), watch, "push"):
        if check_cancelled is not None:
            check_cancelled()
        fixed = given[k] if k < len(given) else None
        order.append(_best(information.gains(), None if factor is None else factor(order)) if fixed is None else fixed)
        information.observe(order[-1])
        variances[k] = information.variance
    return np.array(order, dtype=np.int64), variances


def _best(gains: Array, factor: Array | None) -> int:
    return int(np.argmax(gains if factor is None else gains * factor))
