# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How often `trace` finds something where nothing has changed: its family-wise level, measured.

    python -m benchmarks.blind.levels --base vhgp --mean mechanics --pushes 60 150 600 --out levels

For each rig a model is trained on one simulated recording, and later recordings of the same rig are searched. One JSON
file for each rig; an interrupted run continues. --table prints the rates with 95 % Wilson intervals.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.blind.recordings import later_spec, rig_of
from benchmarks.blind.scores import wilson
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.models.train_learnt import MEANS
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.residuals.channel_search import Searched, search_all
from push_predictor.residuals.evidence.loading import LoadedData, cut_again
from push_predictor.residuals.question import Question
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.spec import SimulationSpec

ALPHAS = (0.2, 0.05, 0.01)
TRAINING = 500  # pushes


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, or print the table of what was measured."""
    options = _parser().parse_args(arguments)
    if options.table:
        print(table_of(options.out))
        return 0
    options.out.mkdir(parents=True, exist_ok=True)
    for number in range(options.first, options.first + options.rigs):
        path = options.out / f"{options.base}_{options.mean}_{options.seed}_{number:03d}.json"
        if not path.exists():
            path.write_text(json.dumps(_of_rig(options, number), indent=1))
            print(path, flush=True)
    return 0


def table_of(folder: Path) -> str:
    """The rates of all files of a folder, as Markdown."""
    found: dict[tuple[str, int, float], list[bool]] = {}
    for path in sorted(folder.glob("*.json")):
        for stream in json.loads(path.read_text())["streams"]:
            for alpha in ALPHAS:
                key = (stream["base"], stream["pushes"], alpha)
                found.setdefault(key, []).append(bool(stream["found"].get(str(alpha))))
    lines = ["| base | pushes | alpha | something found | 95 % interval |", "| --- | --- | --- | --- | --- |"]
    for (base, pushes, alpha), each in sorted(found.items()):
        low, high = wilson(sum(each), len(each))
        interval = f"{100 * low:.1f} to {100 * high:.1f} %"
        lines.append(f"| {base} | {pushes} | {alpha} | {sum(each)} of {len(each)} | {interval} |")
    return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class TrainedRig:
    """A simulated rig, the model trained on its first recording, and the generator of its later ones."""

    plain: SimulationSpec
    rig: Rig
    model: PushModel
    rng: np.random.Generator


def trained_rig(options: argparse.Namespace, number: int) -> TrainedRig:
    """Draw a rig by options.seed and number, and train options.base on options.rows windows of its pushes."""
    rng = np.random.default_rng([options.seed, number])
    plain = rig_of(rng, f"{number:03d}", TRAINING)
    training = simulate(replace(plain, name="training"))
    assert training.rig is not None  # the simulator knows its rig
    table = windows_to_table(find_windows(training, training.rig))
    trained = TrainingOptions(n_train=min(options.rows, len(table)), seed=options.seed, mean=options.mean,
                              fit=options.base == "analytical")  # fmt: skip
    model = train_model(table, training.rig, options.base, name=plain.name, options=trained)
    return TrainedRig(plain, training.rig, model, rng)


def later_windows(rig: TrainedRig, pushes: int) -> LoadedData:
    """The windows of a later recording, in which nothing has changed."""
    later = simulate(replace(later_spec(rig.plain, rig.rng, pushes), name="new"))
    return LoadedData(cut_again([later], rig.rig), None, rig.rig)


def _of_rig(options: argparse.Namespace, number: int) -> dict[str, Any]:
    rig, base = trained_rig(options, number), f"{options.base}, {options.mean}"
    streams = [
        {"base": base, "pushes": pushes, "found": _found(rig.model, later_windows(rig, pushes))}
        for pushes in options.pushes
        for _ in range(options.streams)
    ]
    return {"rig": number, "shape": rig.plain.slider.name, "surface": rig.plain.table.name, "streams": streams}


def _found(model: PushModel, loaded: LoadedData) -> dict[str, list[str]]:
    """What is found at each level; a smaller level is tried only where the larger one found something."""
    found: dict[str, list[str]] = {}
    for alpha in ALPHAS:
        found[str(alpha)] = _names(search_all(Question.of(model, loaded, alpha)))
        if not found[str(alpha)]:
            break
    return found


def _names(searched: Searched) -> list[str]:
    """Channel, mechanism and covariate of everything that was found."""
    errors = searched.measured.effects if searched.measured else ()
    motion = searched.motion
    return [
        *(f"measurement: {error.mechanism} {error.p_value:.4f}" for error in errors),
        *(f"motion: {t.best.mechanism} {t.best.covariate} {t.best.basis.name} {t.p_value:.4f}" for t in motion.terms),
        *(f"variance: {s.covariate} {s.basis.name} {s.ratio:.2f} {s.p_value:.4f}" for s in motion.variance),
        *(f"wrench: {e.mechanism} {e.covariate} {e.p_value:.4f}" for e in searched.forces.effects),
    ]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", default="vhgp", choices=("vhgp", "gp", "analytical"))
    parser.add_argument("--mean", default="mechanics", choices=MEANS, help="of a learnt model (default %(default)s)")
    parser.add_argument("--pushes", type=int, nargs="+", default=[60, 150, 600])
    defaults = (("rigs", 50), ("first", 0), ("streams", 4), ("rows", 300), ("seed", 77))
    for name, default in defaults:
        parser.add_argument(f"--{name}", type=int, default=default, help="(default %(default)s)")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--table", action="store_true", help="print what DIR contains")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
