# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Processor time of a push by the compiled mechanics, for batches of one to a million pushes.

    python -m benchmarks.models.cost_of_a_push [--most N] [--picture FILE]

A batch is one call of FittedMechanics.displacement: its overhead decides small batches, the kernel large ones. The
analytical model, and a patch with eight fitted parameters, alone and with inertia, a slope or grain of the table; to
relative accuracies of 1e-3 and 1e-5. All of one batch size are measured in turns, so that they share the machine's
load. Also printed: a push alone by PushModel.predict, and the time to tabulate a limit surface.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.models.made_up_models import analytical_model, eight_fitted, fitted_model, made_up_table, square_rig
from benchmarks.support.scripts import parser_of, piped, ruled
from push_predictor.blas_threads import one_blas_thread
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics
from push_predictor.models.mechanics.load_map import load_map
from push_predictor.models.mechanics.pressure import patch
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Pushes
from push_predictor.reporting.canvas import draw, grid
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 1_000_000
ACCURACIES = (1e-3, 1e-5)
CALLS = 2000  # timed at most for each batch size, and each a number of pushes of its own
PUSHES = 20_000  # timed for each batch size at least
ROUNDS = 3
ALONE = "alone, PushModel.predict"
ADDED = {"inertia": {"inertia": 0.3}, "slope": {"slope_x": 0.1}, "grain": {"grain_x": 0.2}}


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
    """Print the table; draw the picture."""
    parser = parser_of(__doc__)
    parser.add_argument("--most", type=int, default=MOST, help="pushes of the largest batch (default %(default)s)")
    parser.add_argument("--picture", type=Path, help="file to draw, such as docs/pictures/cost_of_a_push.png")
    options = parser.parse_args(arguments)
    sizes = [10**k for k in range(len(str(options.most)))]
    cases = _cases()
    with one_blas_thread():
        costs = measured(cases, asked(options.most), sizes)
        print(table(costs, sizes))
        for name, seconds in alone().items():
            print(f"{ALONE}, {name}: {1e6 * seconds:.0f} us")
        print(f"tabulation of a patch: {1e3 * tabulation():.0f} ms")
    if options.picture:
        draw(options.picture, (5.2, 3.4), partial(_paint, costs, sizes))
    return 0


def _cases() -> dict[str, FittedMechanics]:
    eight = eight_fitted()
    kinds = {
        "analytical": analytical_mechanics(square_rig().outline, square_rig().pusher_radius),
        "eight fitted": eight,
    }
    kinds |= {f"eight and {name}": replace(eight, values={**eight.values, **more}) for name, more in ADDED.items()}
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


def alone() -> dict[str, float]:
    """Seconds of one PushModel.predict, by model."""
    training = made_up_table(100, 0)
    one = Pushes(0.02, 0.1, 0.3, 0.2, {"push_heading": 0.0})
    models = {"analytical": analytical_model(training), "eight fitted": fitted_model(training)}
    return {name: min(_of_predict(model, one) for _ in range(ROUNDS)) for name, model in models.items()}


def _of_predict(model: PushModel, one: Pushes) -> float:
    return _processor_time(lambda: [model.predict(one) for _ in range(CALLS)]) / CALLS


def tabulation() -> float:
    """Seconds to tabulate the limit surface of a patch: once for a slider."""
    pressure = patch(square_rig().outline, 0.0)
    return min(_processor_time(lambda: load_map(pressure)) for _ in range(ROUNDS))


def _processor_time(work: Callable[[], object]) -> float:
    start = process_time()
    work()
    return process_time() - start


def table(costs: dict[str, list[float]], sizes: list[int]) -> str:
    """Microseconds a push, as Markdown."""
    head = ["mechanics, accuracy", *(f"{size:,}".replace(",", " ") for size in sizes)]
    rows = [[name, *(f"{1e6 * cost:.3g}" for cost in row)] for name, row in costs.items()]
    return "\n".join([ruled(piped(head)), *map(piped, rows)])


def _paint(costs: dict[str, list[float]], sizes: list[int], figure: Figure) -> None:
    axes = figure.subplots()
    for number, (name, row) in enumerate(costs.items()):
        kind, _, accuracy = name.rpartition(", ")
        fine = float(accuracy) == min(ACCURACIES)
        colour = f"C{number % (len(costs) // len(ACCURACIES))}"
        label = None if fine else kind
        axes.loglog(sizes, 1e6 * np.array(row), "--" if fine else "-", color=colour, marker=".", lw=1.2, label=label)
    axes.plot([], [], "-", color="grey", label="accuracy 1e-3")
    axes.plot([], [], "--", color="grey", label="accuracy 1e-5")
    axes.set(xlabel="pushes in a batch", ylabel="processor time of a push (µs)")
    axes.legend(fontsize=6, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    grid(axes)


if __name__ == "__main__":
    raise SystemExit(main())
