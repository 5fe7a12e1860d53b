# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Fitted mechanics on measured pushes: the ladder of `train --kind analytical --fit`, scored on held-out pushes.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.measured.mechanics_ladder --data FOLDER [--kind mit-square|mlab]

FOLDER has mit_square and mlab. A third of the pushes (residuals/evidence/standardised.py), the same as in
benchmarks/measured/ladder.py, is held out. The ladder is fitted to all the others, as the command does it, and each of
its steps is scored on the held-out pushes.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.measured.ladder import HEAD, LADDERS, step_row
from benchmarks.support.scripts import parser_of
from push_predictor.evaluation.ladder_page import parameter_lines
from push_predictor.evaluation.push_scores import PushScores, push_scores
from push_predictor.evaluation.scored_ladder import score_ladder
from push_predictor.models.mechanics.fit import fit_jointly
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.ladder import Rung
from push_predictor.models.predictors import MechanicsPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.models.train_mechanics import fit_rows, predictor_about
from push_predictor.recordings.load import different_supports
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.loading import LoadedData
from push_predictor.residuals.evidence.standardised import digest_of, held_out_rows
from push_predictor.residuals.extension.held_out_gain import compared
from push_predictor.types import Array

QUICK_ROWS = 200


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the ladders."""
    parser = parser_of(__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--kind", choices=sorted(LADDERS))
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_ROWS} windows")
    parser.add_argument("--seed", type=int, default=0, help="of the windows on which the search runs")
    options = parser.parse_args(arguments)
    for kind in [options.kind] if options.kind else sorted(LADDERS):
        with tempfile.TemporaryDirectory() as work:
            loaded = LADDERS[kind](options.data, Path(work))
            supports = different_supports(sorted(Path(work).glob("*.csv")))
        print(f"\n## {kind}\n")
        report(loaded, supports, TrainingOptions(QUICK_ROWS if options.quick else None, options.seed, fit=True))


def report(loaded: LoadedData, supports: Mapping[int, Array], options: TrainingOptions) -> None:
    """Fit the ladder, score its steps on the held-out pushes, and print a row per step and the parameters."""
    aside = held_out_rows(loaded.table)
    search, held = loaded.table.take(~aside), loaded.table.take(aside)
    print(f"{len(search.pushes)} pushes for the fit, {len(held.pushes)} held out, sha256 {digest_of(held)[:12]}")
    begin = time.process_time()
    options = replace(options, supports=supports)
    ladder: list[Rung] = []
    model = train_model(search, loaded.rig, "analytical", name="fitted", options=options, ladder=ladder)
    rows = ladder[0].fit.rows
    print(f"search on {len(rows.push)} windows of {rows.pushes} pushes: {time.process_time() - begin:.0f} CPU s\n")
    print(HEAD)
    scores = [_scores(_of_step(model, rung), held, model.training_mean) for rung in ladder]
    names = [step.change for step in score_ladder(model, ladder).steps]
    for before, after, name in zip([None, *scores], scores, names, strict=False):
        print(step_row(before, after, name), flush=True)
    print("\n" + "\n".join(parameter_lines(score_ladder(model, ladder).final)))


def _of_step(model: PushModel, rung: Rung) -> PushModel:
    """The model of a step, its parameters fitted to all training rows."""
    assert isinstance(model.predictor, MechanicsPredictor)
    mechanics, table = model.predictor.fitted.mechanics, model.training
    fit = fit_jointly(mechanics, fit_rows(table), rung.fit.names, rung.fit.values)
    predictor = predictor_about(FittedMechanics(mechanics, fit.values, fit.covariance), table)
    return PushModel(model.name, model.kind, model.rig, predictor, table, model.provenance)


def _scores(model: PushModel, held: PushTable, reference: Array) -> PushScores:
    return push_scores(compared(model, held, reference))


if __name__ == "__main__":
    main()
