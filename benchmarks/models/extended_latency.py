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

"""Time of one prediction of an extended model in the server's process: effects computed, and from a table.

    python -m benchmarks.models.extended_latency [--pushes N] [--seed K]

No ROS. The base is a GP of 300 simulated windows, alone or about mechanics, or the analytical model. Every push is
predicted by the tabulated base, by the extended model with computed effects (before) and with a table of them (now),
in turns, so that all share the machine's load. Ratio: before to now. Apart: differences of means between both, in
predicted standard deviations; those of covariances, relative, as tables are judged. Build: CPU time of the table.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from time import perf_counter, process_time

import numpy as np

from benchmarks.models.made_up_models import (
    DRIFT,
    analytical_model,
    base_model,
    drifting_effect,
    extended_model,
    informed_model,
    made_up_table,
    spread_effect,
)
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.table_accuracy import relative_error
from push_predictor.models.tabulated.tabulated_model import TabulatedModel, tabulate, with_effect_table
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

Ask = Callable[[Array, Array, Mapping[str, Array]], Prediction]

REPEATS = 3  # of each push, in turns: a busy machine interrupts some

ALWAYS = DriverBasis("constant")
LATER = DriverBasis("step", ("elapsed_time",), place=500.0)
AROUND = DriverBasis("periodic", ("slider_heading",))
MAP = DriverBasis("map", ("slider_x", "slider_y"), (0.0, 0.0), (0.1, 0.1))
EFFECTS: dict[str, tuple[Effect, ...]] = {
    "friction, constant": (spread_effect("contact_friction", ALWAYS),),
    "friction, step": (spread_effect("contact_friction", LATER),),
    "friction, linear": (spread_effect("contact_friction", DRIFT),),
    "friction, map": (spread_effect("contact_friction", MAP, 0.4),),
    "friction, periodic": (spread_effect("contact_friction", AROUND),),
    "centre, linear": (spread_effect("centre_of_friction", DRIFT),),
    "grain of the table": (spread_effect("anisotropic_friction", ALWAYS),),
    "centre, step; friction, linear": (
        spread_effect("centre_of_friction", LATER),
        spread_effect("contact_friction", DRIFT),
    ),
    "polynomial, linear": (drifting_effect(None, *np.full(18, 0.1)),),
}


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pushes", type=int, default=300, help="of each model (default 300)")
    parser.add_argument("--seed", type=int, default=1, help="of the pushes (default 1)")
    options = parser.parse_args()
    learnt, table = base_model(), made_up_table(options.pushes, options.seed)
    table_of_base = learnt.training
    bases = {"GP": learnt, "GP about mechanics": informed_model(learnt), "analytical": analytical_model(table_of_base)}
    print(
        "| base | effects | base, us | before, us | now, us | ratio "
        "| means apart: median | 99 % | covariances: 99 % | build, s |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name, base in bases.items():
        for effects, acting in EFFECTS.items():
            print(f"| {name} | {effects} | {_row(base, extended_model(base, *acting), table)} |", flush=True)


def _row(base: PushModel, model: PushModel, table: PushTable) -> str:
    computed, start = tabulate(model), process_time()
    tabled = with_effect_table(computed)
    build = process_time() - start
    plain, before, now = _times([m.predict_rows for m in (tabulate(base), computed, tabled)], table)
    times = f"{plain:.0f} | {before:.0f} | {now:.0f} | {before / now:.1f}"
    if tabled.effects is None:
        return f"{times} | no table | | | {build:.1f}"
    of_mean, of_covariance = _apart(computed, tabled, table)
    apart = f"{np.median(of_mean):.4f} | {np.quantile(of_mean, 0.99):.3f}"
    return f"{times} | {apart} | {100.0 * np.quantile(of_covariance, 0.99):.1f} % | {build:.1f}"


def _times(asks: list[Ask], table: PushTable) -> list[float]:
    """Median time of each callable over the pushes, us; the least of REPEATS for each push."""
    times = np.empty((len(table), REPEATS, len(asks)))
    for k in range(len(table)):
        row = table.take(np.arange(k, k + 1))
        for repeat in range(REPEATS):
            for number, ask in enumerate(asks):
                start = perf_counter()
                ask(row.inputs, row.duration, row.covariates)
                times[k, repeat, number] = perf_counter() - start
    return [float(value) * 1e6 for value in np.median(times.min(axis=1), axis=0)]


def _apart(computed: TabulatedModel, tabled: TabulatedModel, table: PushTable) -> tuple[Array, Array]:
    """Per push, the largest difference of a mean, in standard deviations, and the relative one of the covariance."""
    ours, theirs = (model.predict_rows(table.inputs, table.duration, table.covariates) for model in (tabled, computed))
    of_mean = (np.abs(ours.mean - theirs.mean) / theirs.std).max(axis=1)
    return np.asarray(of_mean), relative_error(ours.covariance, theirs.covariance)


if __name__ == "__main__":
    main()
