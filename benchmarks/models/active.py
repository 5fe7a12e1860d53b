# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How many pushes a model needs when its pushes are chosen: `suggest` next to other ways, from a pool of pushes.

    export OPENBLAS_NUM_THREADS=1
    python -m benchmarks.models.active run --out FILE [--data FOLDER] [--rigs SHAPE:SURFACE:SEED ...] [--models M ...]
    python -m benchmarks.models.active table FILE

--data: the folder of the measured data: whole pushes of mit_square are chosen from four of five folds, and the fifth is
predicted. --rigs: simulated ones, each with a pool of 300 pushes and 100 others to predict. `run` appends one line per
trained model to FILE; `table` prints the tables of docs/results/prior.md. "prior, adapted" follows push by push.

Every way starts with its own first batch and grows to the sizes below; the model is trained again after each batch. The
pushes that matter are those of the pool, of which a way sees the inputs of all and the outcomes of those it has chosen.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.measured.square import imported_square
from benchmarks.models.active_table import REFERENCE, print_tables
from benchmarks.support.scripts import parser_of
from push_predictor.adaptation import Adaptation
from push_predictor.design.batch import CHOSEN_OF_PRIOR, FIRST, information_of
from push_predictor.design.candidates import Courses
from push_predictor.design.information import Information
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.evaluation.splits import FOLDS, push_folds
from push_predictor.evaluation.validation import compare
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.models.train_learnt import MeanChoice
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable, empty_table
from push_predictor.simulation.outcomes import push_outcomes
from push_predictor.simulation.pushes import random_pushes
from push_predictor.simulation.spec import SimulationSpec, simulated_rig
from push_predictor.types import Array, IntArray

SIZES = {"mit_square": (5, 10, 15, 20, 30, 40, 60), "simulated": (5, 10, 20, 50, 200)}
LARGEST_CHOSEN = {"mit_square": 40, "simulated": 50}  # by other ways than the reference
MODELS: dict[str, tuple[str, MeanChoice]] = {
    "gp": ("gp", "zero"),
    "prior": ("prior", "zero"),
    "prior, adapted": ("prior", "zero"),
    "gp, mechanics": ("gp", "mechanics"),
    "vhgp, mechanics": ("vhgp", "mechanics"),
}
WAYS = ("random", "Sobol", "suggest")
WINDOWS = {"mit_square": 12, "simulated": 3}  # of a push that a model is trained on
LOOKED_AT = {"mit_square": 6, "simulated": 3}  # windows of a push of the pool, and of those that matter, in the design
MATTER = 128
POOL, TESTED, SPEEDS = 300, 100, (0.02, 0.05)


@dataclass(frozen=True, eq=False)
class Case:
    """A pool of pushes to choose from, others to predict, and their rig."""

    kind: str
    name: str
    pool: PushTable
    test: PushTable
    rig: Rig


def main(arguments: Sequence[str] | None = None) -> None:
    """Train and score the models, or print the tables."""
    parser = parser_of(__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run")
    run.add_argument("--out", type=Path, required=True)
    run.add_argument("--data", type=Path)
    run.add_argument("--rigs", nargs="*", default=[])
    run.add_argument("--models", nargs="+", choices=tuple(MODELS), default=tuple(MODELS))
    run.add_argument("--ways", nargs="+", choices=WAYS, default=WAYS)
    run.add_argument("--sizes", nargs="+", type=int, help="numbers of pushes, instead of the usual ones")
    run.add_argument("--draws", type=int, default=2, help="draws of random pushes for each case")
    commands.add_parser("table").add_argument("file", type=Path)
    options = parser.parse_args(arguments)
    if options.command == "table":
        print_tables(options.file)
        return
    for case in _cases(options.data, options.rigs):
        for model in options.models:
            for way in options.ways:
                for draw in range(options.draws if way == "random" else 1):
                    _grow(case, model, way, draw, options.sizes or SIZES[case.kind], options.out)


def _cases(data: Path | None, rigs: Sequence[str]) -> Iterator[Case]:
    if data is not None:
        with tempfile.TemporaryDirectory() as work:
            square = imported_square(data, Path(work))
        fold, table = push_folds(square.table), square.table
        for k in range(FOLDS):
            pool = thinned(table.take(fold != k), WINDOWS["mit_square"])
            yield Case("mit_square", f"fold {k}", pool, table.take(fold == k), square.rig)
    for rig in rigs:
        shape, surface, seed = rig.split(":")
        yield _simulated(shape, surface, int(seed))


def _simulated(shape: str, surface: str, seed: int) -> Case:
    plan = random_pushes(POOL + TESTED, SPEEDS, rng=np.random.default_rng([seed, 17]))
    spec = SimulationSpec(shape, surface, plan, seed=seed, surface_seed=seed, slider_seed=seed)
    table = push_outcomes(spec)
    tested = table.push_id.astype(np.int64) >= POOL
    pool = thinned(table.take(~tested), WINDOWS["simulated"])
    return Case("simulated", f"{shape}:{surface}:{seed}", pool, table.take(tested), simulated_rig(spec))


def thinned(table: PushTable, most: int) -> PushTable:
    """At most so many windows of each push, evenly over its rows."""
    rows = [np.flatnonzero(table.push_id == push) for push in table.pushes]
    return table.take(np.concatenate([r[np.linspace(0, len(r) - 1, min(most, len(r))).astype(int)] for r in rows]))


def _grow(case: Case, model: str, way: str, draw: int, sizes: Sequence[int], out: Path) -> None:
    """Choose pushes in batches and append the scores of a model of each size to the file."""
    rng = np.random.default_rng([draw, *case.name.encode()])
    names, taken = np.array(case.pool.pushes), np.zeros(0, dtype=np.int64)
    trained: PushModel | None = None
    most = len(names) if (model, way) == REFERENCE else LARGEST_CHOSEN[case.kind]
    for n in (n for n in sizes if n <= most):
        taken = np.append(taken, _chosen(case, model, way, trained, taken, n - len(taken), rng))
        rows = case.pool.take(np.isin(case.pool.push_id, names[taken]))
        trained = _train(case, model, rows)
        _append(out, case, model, way, draw, n, trained)


def _train(case: Case, model: str, rows: PushTable) -> PushModel:
    kind, mean = MODELS[model]
    if model == "prior, adapted":
        adaptation = Adaptation(train_model(empty_table(), case.rig, kind, name=model))
        for push in rows.pushes:
            adaptation.update(rows.take(rows.push_id == push))
        return adaptation.adapted
    return train_model(rows, case.rig, kind, name=model, options=TrainingOptions(mean=mean))


def _append(out: Path, case: Case, model: str, way: str, draw: int, n: int, trained: PushModel) -> None:
    """The reference of the NMSE is the mean of the pool, the same for all."""
    comparison = replace(compare(trained, case.test), training_mean=case.pool.outcomes.mean(axis=0))
    scores = push_scores(comparison)
    sums = {key: getattr(scores, key).tolist() for key in ("windows", "error", "spread", "exact_nlpd")}
    head = {"kind": case.kind, "case": case.name, "model": model, "way": way, "draw": draw, "pushes": n}
    with out.open("a") as file:
        file.write(json.dumps({**head, "push_id": scores.push_id.tolist(), **sums}) + "\n")
    nmse = float((scores.error.sum(axis=0) / scores.spread.sum(axis=0)).sum())
    nlpd = float(scores.exact_nlpd.sum() / scores.windows.sum())
    print(f"{case.name:16} {model:14} {way:9} {draw} {n:4} NMSE {nmse:.3f} NLPD {nlpd:.2f}", flush=True)


# --- ways of choosing ---------------------------------------------------------------------------------------------


def _chosen(
    case: Case,
    model: str,
    way: str,
    trained: PushModel | None,
    taken: IntArray,
    count: int,
    rng: np.random.Generator,
) -> IntArray:
    """Indices (count,) of further pushes of the pool.

    The first pushes are random without mechanics, and chosen by a prior model with them, unless they are spread evenly.
    """
    left = np.setdiff1d(np.arange(len(case.pool.pushes)), taken)
    if way == "Sobol" or _spread_evenly(model, way, len(taken)):
        return _nearest_to_sobol(case, left, len(taken), count)
    if trained is None and model != "gp":
        trained = train_model(empty_table(), case.rig, "prior", name="prior")
    if way == "random" or trained is None:
        return rng.choice(left, count, replace=False)
    tried, matter = _pool_courses(case, left), _pool_windows(case)
    return left[distinct(information_of(trained, tried, matter), count)]


def _spread_evenly(model: str, way: str, taken: int) -> bool:
    """Whether `suggest` takes the next pushes from the Sobol' sequence."""
    if way != "suggest":
        return False
    return taken >= CHOSEN_OF_PRIOR if model == "prior" else model == "gp" and taken < FIRST


def distinct(information: Information, count: int) -> IntArray:
    """Candidates (count,) with the largest gain in turn, none of them twice: a recorded push cannot be made again."""
    chosen: list[int] = []
    for _ in range(count):
        gains = information.gains()
        gains[chosen] = -np.inf
        chosen.append(int(np.argmax(gains)))
        information.observe(chosen[-1])
    return np.array(chosen, dtype=np.int64)


def _nearest_to_sobol(case: Case, left: IntArray, begin: int, count: int) -> IntArray:
    """The pushes whose first windows are nearest to the next points of a Sobol' sequence over the pool's range."""
    from scipy.stats import qmc

    first = _first_windows(case)
    low, high = first.min(axis=0), first.max(axis=0)
    scaled = (first - low) / np.maximum(high - low, 1e-9)
    scaled[:, 1] = first[:, 1]
    chosen: list[int] = []
    for point in qmc.Sobol(3, seed=0).random(512)[begin : begin + count]:
        point[1] = low[1] + point[1] * (high[1] - low[1])
        away = np.abs(scaled[left] - point)
        away[:, 1] = np.minimum(away[:, 1], 1.0 - away[:, 1]) / max(high[1] - low[1], 1e-9)
        away[chosen] = np.inf
        chosen.append(int(np.argmin(np.sum(away**2, axis=1))))
    return np.asarray(left[chosen])


def _first_windows(case: Case) -> Array:
    return np.array([case.pool.inputs[case.pool.push_id == push][0] for push in case.pool.pushes])


def _pool_courses(case: Case, left: IntArray) -> Courses:
    most, names = LOOKED_AT[case.kind], np.array(case.pool.pushes)
    inputs, kept = np.zeros((len(left), most, 3)), np.zeros((len(left), most), dtype=np.bool_)
    for k, push in enumerate(names[left]):
        rows = case.pool.inputs[case.pool.push_id == push]
        rows = rows[np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int)]
        inputs[k, : len(rows)], kept[k, : len(rows)] = rows, True
    duration = float(np.median(case.pool.duration))
    return Courses(inputs, kept, duration)


def _pool_windows(case: Case) -> Push:
    rows = np.linspace(0, len(case.pool) - 1, MATTER).astype(int)
    return Push(case.pool.inputs[rows], case.pool.duration[rows], {})


if __name__ == "__main__":
    main()
