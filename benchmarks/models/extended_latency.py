"""Time of one prediction of an extended model in the server's process, effect by effect.

    python -m benchmarks.models.extended_latency [--pushes N] [--seed K]

No ROS. The base is a GP of 300 simulated windows. Every push is predicted by the tabulated base, by the tabulated
extended model, and by the latter with array code for its effects (as before scalar code), in turns, so that all share
the machine's load. Ratio: to the base's prediction in the same run. Apart: largest difference of a mean between scalar
code and the model itself, in predicted standard deviations.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from time import perf_counter

import numpy as np

from benchmarks.models.made_up_models import (
    analytical_model,
    base_model,
    drifting_effect,
    extended_model,
    made_up_table,
)
from push_predictor.models.mechanisms import Push
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors import Moments
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.tabulated_model import tabulate
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

Ask = Callable[[Array, Array, Mapping[str, Array]], Prediction]


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pushes", type=int, default=300, help="of each model (default 300)")
    parser.add_argument("--seed", type=int, default=1, help="of the pushes (default 1)")
    options = parser.parse_args()
    base, table = base_model(), made_up_table(options.pushes, options.seed)
    friction, centre = drifting_effect("contact_friction", 0.05), drifting_effect("centre_of_friction", 1e-3, 1e-3)
    models = {
        "contact_friction": extended_model(base, friction),
        "centre_of_friction": extended_model(base, centre),
        "both": extended_model(base, friction, centre),
        "generic": extended_model(base, drifting_effect(None, *np.full(18, 0.1))),
        "anisotropic_friction": extended_model(base, drifting_effect("anisotropic_friction", 0.1, 0.05)),
        "analytical, no effect": analytical_model(base),
    }
    print(f"{'p50, us':24s}{'base':>8s}{'before':>8s}{'now':>8s}{'ratio':>8s}{'was':>8s}{'apart':>10s}")
    for name, model in models.items():
        first, before, now = _times([tabulate(base).predict_rows, _before(model), tabulate(model).predict_rows], table)
        print(
            f"{name:24s}{first:8.0f}{before:8.0f}{now:8.0f}{now / first:8.1f}{before / first:8.1f}"
            f"{_apart(model, table):10.1e}"
        )


def _before(model: PushModel) -> Ask:
    """Predictions by the tabulated base and array code for the effects."""
    predictor = model.predictor
    if not predictor.effects:
        return model.predict_rows
    base = tabulate(model.base)

    def predict_rows(inputs: Array, duration: Array, covariates: Mapping[str, Array]) -> Prediction:
        found = base.predict_rows(inputs, duration)
        moments = Moments(found.mean, found.covariance, found.process_covariance)
        return Prediction(*predictor.with_effects(moments, Push(inputs, duration, covariates)), found.in_domain)

    return predict_rows


def _times(asks: list[Ask], table: PushTable) -> list[float]:
    """Median time of each callable, us."""
    times: list[list[float]] = [[] for _ in asks]
    for k in range(len(table)):
        row = table.take(np.arange(k, k + 1))
        for ask, taken in zip(asks, times, strict=True):
            start = perf_counter()
            ask(row.inputs, row.duration, row.covariates)
            taken.append(perf_counter() - start)
    return [float(np.median(taken)) * 1e6 for taken in times]


def _apart(model: PushModel, table: PushTable) -> float:
    """Largest difference of a mean between scalar and array code over single pushes, in standard deviations."""
    tabulated, before, apart = tabulate(model), _before(model), 0.0
    for k in range(len(table)):
        row = table.take(np.arange(k, k + 1))
        ours, theirs = (ask(row.inputs, row.duration, row.covariates) for ask in (tabulated.predict_rows, before))
        sd = np.sqrt(np.diagonal(theirs.covariance[0]))
        apart = max(apart, float(np.max(np.abs(ours.mean - theirs.mean) / sd)))
    return apart


if __name__ == "__main__":
    main()
