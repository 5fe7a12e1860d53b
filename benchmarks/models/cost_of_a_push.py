# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Processor time of a push by the compiled mechanics, for batches of one to a million pushes.

    python -m benchmarks.models.cost_of_a_push [--most N]

A batch is one call of FittedMechanics.displacement: its overhead decides small batches, the kernel large ones. The
analytical model, and a patch with eight fitted parameters, without and with inertia; to relative accuracies of 1e-3
and 1e-5. All of one batch size are measured in turns, so that they share the machine's load.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from benchmarks.models.made_up_models import eight_fitted, square_rig
from benchmarks.support.scripts import parser_of, piped, ruled
from push_predictor.blas_threads import one_blas_thread
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics
from push_predictor.types import Array

MOST = 1_000_000
ACCURACIES = (1e-3, 1e-5)
CALLS = 2000  # timed at most for each batch size, and each a number of pushes of its own
PUSHES = 20_000  # timed for each batch size at least
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Asked:
    """Random pushes of 0.2 s at 20 to 100 mm/s: inputs (n, 3), duration (n,), heading in the world (n,)."""

    inputs: Array
    duration: Array
    heading: Array

    def displaced(self, mechanics: FittedMechanics, rows: slice) -> None:
        """Compute the displacements of some of them in one call."""
        mechanics.displacement(self.inputs[rows], self.duration[rows], {"push_heading": self.heading[rows]})


def main(arguments: list[str] | None = None) -> int:
    """Print the table, microseconds a push, as Markdown."""
    parser = parser_of(__doc__)
    parser.add_argument("--most", type=int, default=MOST, help="pushes of the largest batch (default %(default)s)")
    sizes = [10**k for k in range(len(str(parser.parse_args(arguments).most)))]
    with one_blas_thread():
        print(ruled(piped(["mechanics, accuracy", *sizes])))
        for name, row in measured(_cases(), asked(sizes[-1]), sizes).items():
            print(piped([name, *(f"{1e6 * seconds:.3g}" for seconds in row)]))
    return 0


def _cases() -> dict[str, FittedMechanics]:
    eight, rig = eight_fitted(), square_rig()
    kinds = {
        "analytical": analytical_mechanics(rig.outline, rig.pusher_radius),
        "eight fitted": eight,
        "eight and inertia": replace(eight, values={**eight.values, "inertia": 0.3}),
    }
    return {
        f"{name}, {accuracy:g}": replace(fitted, mechanics=replace(fitted.mechanics, accuracy=accuracy))
        for accuracy in ACCURACIES
        for name, fitted in kinds.items()
    }


def asked(n: int) -> Asked:
    """Random pushes."""
    rng = np.random.default_rng(0)
    inputs = np.column_stack([rng.uniform(0.02, 0.1, n), rng.random(n), rng.uniform(-1.2, 1.2, n)])
    return Asked(inputs, np.full(n, 0.2), rng.uniform(-3.0, 3.0, n))


def measured(cases: dict[str, FittedMechanics], pushes: Asked, sizes: list[int]) -> dict[str, list[float]]:
    """Seconds a push, by case, for each batch size: the least of some rounds, in each of which all take their turn.

    Batches of more than PUSHES are computed once.
    """
    costs: dict[str, list[float]] = {name: [] for name in cases}
    for mechanics in cases.values():  # tabulates
        pushes.displaced(mechanics, slice(0, 1))
    for size in sizes:
        calls = min(CALLS, max(1, PUSHES // size), len(pushes.duration) // size)
        repeats = ROUNDS if size <= PUSHES else 1
        rounds = [[_seconds(mechanics, pushes, size, calls) for mechanics in cases.values()] for _ in range(repeats)]
        for name, seconds in zip(cases, np.min(rounds, axis=0), strict=True):
            costs[name].append(float(seconds) / (size * calls))
    return costs


def _seconds(mechanics: FittedMechanics, pushes: Asked, size: int, calls: int) -> float:
    rows = [slice(k * size, (k + 1) * size) for k in range(calls)]
    start = process_time()
    for each in rows:
        pushes.displaced(mechanics, each)
    return process_time() - start


if __name__ == "__main__":
    raise SystemExit(main())
