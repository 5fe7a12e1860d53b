# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What models are trained and tested on: simulated and measured pushes, by a name that a command line can give.

The training pushes of a case are never tested on. The 16 pairs are the shapes and surfaces of the paper.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from push_predictor_paper.data.corpus import learning_set
from push_predictor_paper.plan import FULL

from benchmarks.models.rigs_at_speeds import RIGS, session
from push_predictor.evaluation.splits import FOLDS, split_by_push
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable, concatenate, empty_table

BAGS = Path(__file__).resolve().parents[2] / "bags"
SEEDS = 3  # draws of training pushes of the simulated square
PAIRS = replace(FULL, pushes=240, reference_pushes=240)
PAIR_FOLDS = 2  # of five: 96 test pushes of each pair
OTHER_RIGS = 2  # of each simulator
TRAINED, ASKED = 0.02, (0.01, 0.02, 0.04, 0.08, 0.15)  # m/s
PUSHES, TEST_PUSHES = 100, 120  # of each of the other rigs
MOST_WINDOWS = 2  # of a test push at another speed, so that slow pushes, which have more, count as much


@dataclass(frozen=True, eq=False)
class Case:
    """Rows to draw training windows from, in the order in which they are drawn, rows to test on, and the rig.

    seed: of the draw. The training table is empty where only the model before the first push is tested.
    """

    training: PushTable
    test: PushTable
    rig: Rig
    seed: int = 0


def cases_named(name: str, data: Path | None, work: Path) -> dict[str, list[Case]]:
    """The cases by what they are tested on. data: the folder of the measured data, where they need it."""
    if name in MEASURED:
        if data is None:
            raise SystemExit(f"--cases {name}: needs --data, the folder of the measured data")
        return MEASURED[name](data, work)
    return SIMULATED[name](work)


def measured_square(data: Path, work: Path) -> dict[str, list[Case]]:
    """The 3500 windows of mit_square, in five folds of pushes."""
    import_source("mit-square", [data / "mit_square" / "pushes_3500.npz"], work)
    return {"mit_square": folds_of(*_loaded(work / "pushes_3500.csv"))}


def measured_triangle(data: Path, work: Path) -> dict[str, list[Case]]:
    """The logs of mlab, each on its own supports, without training pushes."""
    import_source("mlab", [data / "mlab" / "sensor_log"], work / "mlab")
    logs = {path.stem: _loaded(path) for path in sorted((work / "mlab").glob("*.csv"))}
    return {f"mlab {name}": [Case(empty_table(), table, rig)] for name, (table, rig) in logs.items()}


def long_pushes(data: Path, work: Path) -> dict[str, list[Case]]:
    """The runs of mcube, each tested with the others of its block as training."""
    runs = sorted(import_source("mcube", [data / "mcube_preliminary"], work / "mcube").written)
    blocks = {"aluminium": "Al", "steel": "St"}
    return {name: runs_in_turn([run for run in runs if run.name.startswith(b)]) for name, b in blocks.items()}


def runs_in_turn(runs: Sequence[Path]) -> list[Case]:
    """Every recording tested in turn, the others as training."""
    rig, tables = load_rig_for(runs), [load_data([run]) for run in runs]
    tables = [
        replace(table, push_id=np.char.add(f"{run.name}/", table.push_id))
        for run, table in zip(runs, tables, strict=True)
    ]
    return [Case(concatenate(tables[:k] + tables[k + 1 :]), tables[k], rig) for k in range(len(runs))]


def simulated_square(work: Path) -> dict[str, list[Case]]:
    """`bags/square_abs_test`, by models of `bags/square_abs_train`."""
    training, rig = _loaded(BAGS / "square_abs_train")
    test, orders = load_data([BAGS / "square_abs_test"]), [np.random.default_rng(seed) for seed in range(SEEDS)]
    drawn = [training.take(order.permutation(len(training))) for order in orders]
    return {"square_abs_test": [Case(table, test, rig, seed) for seed, table in enumerate(drawn)]}


def simulated_pairs(work: Path) -> dict[str, list[Case]]:
    """Two of five folds of pushes of every pair, all together."""
    every = []
    for pair in PAIRS.pairs:
        pushes = learning_set(PAIRS, *pair)
        named = replace(pushes.table, push_id=np.char.add(f"{' '.join(pair)} ", pushes.table.push_id))
        every += folds_of(pushes.table, pushes.rig, PAIR_FOLDS, named)
    return {f"{len(PAIRS.pairs)} simulated pairs": every}


def other_speeds(work: Path) -> dict[str, list[Case]]:
    """Rigs of three simulators: models of pushes at one speed, and next to them at all, asked at all."""
    found = {}
    for simulator in RIGS:
        for speeds, which in (((TRAINED,), 0), (ASKED, 1)):
            title = f"{simulator}, trained at {', '.join(f'{1e3 * speed:g}' for speed in speeds)} mm/s"
            found[title] = [_at_speeds(simulator, number, which, speeds, work) for number in range(OTHER_RIGS)]
    return found


SIMULATED: dict[str, Callable[[Path], dict[str, list[Case]]]] = {
    "simulated-square": simulated_square,
    "pairs": simulated_pairs,
    "speeds": other_speeds,
}
MEASURED: dict[str, Callable[[Path, Path], dict[str, list[Case]]]] = {
    "mit-square": measured_square,
    "mlab": measured_triangle,
    "mcube": long_pushes,
}


def folds_of(table: PushTable, rig: Rig, count: int = FOLDS, named: PushTable | None = None) -> list[Case]:
    """Folds of whole pushes, the training rows in the order in which they are drawn; named: the rows as they count."""
    splits, rows = [split_by_push(table, fold) for fold in range(count)], named or table
    return [Case(rows.take(split.training), rows.take(split.test), rig, k) for k, split in enumerate(splits)]


def few_windows(table: PushTable, most: int) -> PushTable:
    """Random rows of the table, at most so many of a push."""
    order = np.random.default_rng(0).permutation(len(table))
    _, push = np.unique(table.push_id[order], return_inverse=True)
    earlier = np.array([np.sum(push[:row] == push[row]) for row in range(len(push))])
    return table.take(np.sort(order[earlier < most]))


def _at_speeds(simulator: str, number: int, which: int, speeds: Sequence[float], work: Path) -> Case:
    pushes = PUSHES if which == 0 else TEST_PUSHES
    training, rig = session(simulator, number, which, pushes, speeds, work)
    test = few_windows(session(simulator, number, 2, TEST_PUSHES, ASKED, work)[0], MOST_WINDOWS)
    return Case(training.take(np.random.default_rng(0).permutation(len(training))), _of_rig(test, number), rig, number)


def _of_rig(table: PushTable, number: int) -> PushTable:
    return replace(table, push_id=np.char.add(f"{number} ", table.push_id))


def _loaded(path: Path) -> tuple[PushTable, Rig]:
    return load_data([path]), load_rig_for([path])


def in_temporary_folder(names: Sequence[str], data: Path | None) -> dict[str, list[Case]]:
    """All cases of these names, imported and simulated into a folder that is removed."""
    with tempfile.TemporaryDirectory() as work:
        return {title: cases for name in names for title, cases in cases_named(name, data, Path(work)).items()}
