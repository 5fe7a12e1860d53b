# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The level of the screen for effects on the motion, on real designs with made-up noise.

    python -m benchmarks.blind.screen_levels --pushes 60 150 --rigs 5 --draws 40 [--base vhgp|analytical] [--json FILE]

Inputs, covariates, candidates and the training windows are those of simulated recordings; the standardised residuals
are drawn, half of their variance common to the windows of a push, with a spread of its own for each push. Nothing can
be found but by chance. The table gives how often the smallest family-wise p value was at most alpha.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.blind.recordings import later_spec, rig_of, windows_of
from benchmarks.blind.scores import wilson
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.models.train_learnt import MEANS
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import Candidate, candidates_of
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, inputs_basis
from push_predictor.residuals.evidence.loading import cut_again
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of, held_out_rows
from push_predictor.residuals.selection.gate import Baseline, Gate, baseline_of
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.spec import SimulationSpec, simulated_rig
from push_predictor.types import Array

ALPHAS = (0.2, 0.05, 0.01)
TRAINING = 500  # pushes
UNEVEN = 0.4  # standard deviation of the logarithm of a push's spread


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, and write the p values to the file of --json."""
    options = _parser().parse_args(arguments)
    found: dict[int, list[float]] = {pushes: [] for pushes in options.pushes}
    for number in range(options.rigs):
        rig = _trained_rig(options, number)
        for pushes in options.pushes:
            design = _design(rig.model, _later_windows(rig, pushes))
            found[pushes] += list(_smallest(design, rig.rng, options.draws))
    if options.json:
        options.json.write_text(json.dumps(found))
    print(_table(f"{options.base}, {options.mean}" if options.base != "analytical" else options.base, found))
    return 0


@dataclass(frozen=True, eq=False)
class _TrainedRig:
    """A simulated rig, the model trained on its first recording, and the generator of its later ones."""

    plain: SimulationSpec
    model: PushModel
    rng: np.random.Generator


def _trained_rig(options: argparse.Namespace, number: int) -> _TrainedRig:
    """Draw a rig by options.seed and number, and train options.base on options.rows windows of its pushes."""
    rng = np.random.default_rng([options.seed, number])
    plain = rig_of(rng, f"{number:03d}", TRAINING)
    table = windows_of(replace(plain, name="training"))
    trained = TrainingOptions(n_train=min(options.rows, len(table)), seed=options.seed, mean=options.mean,
                              fit=options.base == "analytical")  # fmt: skip
    model = train_model(table, simulated_rig(plain), options.base, name=plain.name, options=trained)
    return _TrainedRig(plain, model, rng)


def _later_windows(rig: _TrainedRig, pushes: int) -> PushTable:
    """The windows of a later recording, in which nothing has changed."""
    later = simulate(replace(later_spec(rig.plain, rig.rng, pushes), name="new"))
    return cut_again([later], rig.model.rig)


@dataclass(frozen=True, eq=False)
class _Design:
    evidence: Evidence
    inputs: InputsBasis
    baseline: Baseline
    candidates: tuple[Candidate, ...]


def _design(model: PushModel, table: PushTable) -> _Design:
    analysis = table.take(~held_out_rows(table))
    evidence, inputs = evidence_of(model, analysis), inputs_basis(model, analysis)
    baseline = baseline_of(model, evidence.mechanics, evidence.table.inputs)
    candidates = tuple(candidates_of(evidence, None, inputs))
    return _Design(evidence, inputs, baseline, candidates)


def _smallest(design: _Design, rng: np.random.Generator, draws: int) -> Iterator[float]:
    """The smallest family-wise p value of each draw of the noise."""
    for _ in range(draws):
        before = design.baseline.evidence
        z = _noise(rng, before.table)
        residual = np.asarray(np.linalg.solve(before.whitener, z[:, :, None])[:, :, 0], dtype=np.float64)
        redrawn = replace(before, residual=residual)
        baseline = replace(design.baseline, evidence=redrawn)
        gate = Gate(design.evidence, design.candidates, design.inputs, max(ALPHAS), 0, baseline)
        yield float(gate.screened(_noise(rng, design.evidence.table)).p_value.min())


def _noise(rng: np.random.Generator, table: PushTable) -> Array:
    """Residuals (n, 3): half of the variance common to a push, times a spread of the push."""
    pushes, push = np.unique(table.push_id, return_inverse=True)
    common, own = rng.standard_normal((len(pushes), 3))[push], rng.standard_normal((len(table), 3))
    spread = np.exp(UNEVEN * rng.standard_normal((len(pushes), 1)))[push]
    return np.asarray(np.sqrt(0.5) * (common + own) * spread)


def _table(base: str, found: dict[int, list[float]]) -> str:
    lines = ["| base | pushes | alpha | p at most alpha | 95 % interval |", "| --- | --- | --- | --- | --- |"]
    for pushes, p_values in found.items():
        for alpha in ALPHAS:
            count = int(np.sum(np.array(p_values) <= alpha))
            low, high = wilson(count, len(p_values))
            interval = f"{100 * low:.1f} to {100 * high:.1f} %"
            lines.append(f"| {base} | {pushes} | {alpha} | {count} of {len(p_values)} | {interval} |")
    return "\n".join(lines)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", default="vhgp", choices=("vhgp", "gp", "analytical"))
    parser.add_argument("--mean", default="mechanics", choices=MEANS, help="of a learnt model (default %(default)s)")
    parser.add_argument("--pushes", type=int, nargs="+", default=[60, 150])
    for name, default in (("rigs", 5), ("draws", 40), ("rows", 300), ("seed", 78)):
        parser.add_argument(f"--{name}", type=int, default=default, help="(default %(default)s)")
    parser.add_argument("--json", type=Path)
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
