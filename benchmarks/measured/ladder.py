# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What an analytical model lacks on measured pushes: `trace`, and fitted mechanics, on the same held-out pushes.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.measured.ladder --data FOLDER [--kind mit-square|mlab] [--base BASE]

FOLDER has mit_square and mlab. `trace` is called as by its command, with the covariates of the data. It holds out a
third of the pushes (residuals/evidence/standardised.py) and uses them once, at the end. BASE is the textbook model (an
ellipsoidal limit surface, contact friction 0.3) or `exact`: the exact forward model with the textbook's parameters and,
where the names of the recordings state them, the support points. No base is fitted, only its covariance is. The fitted
mechanics are those of `train --kind analytical --fit`, of all pushes that are not held out.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.support.scripts import parser_of, piped, ruled
from push_predictor.evaluation.estimate import by_push, difference_by_push, total_nlpd, total_nmse
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.pressure import supported_at
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.models.train_mechanics import predictor_about
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.load import different_supports
from push_predictor.residuals.evidence.loading import LoadedData, load_evidence
from push_predictor.residuals.evidence.standardised import held_out_rows
from push_predictor.residuals.extension.held_out_gain import compared
from push_predictor.residuals.trace import trace
from push_predictor.types import Array

HEAD = "| model | NMSE (95 %) | NLPD (95 %) | NMSE minus the base (95 %) | NLPD minus the base (95 %) |"
ORDER = ("row_id", "push_index")  # meaningless in the square's table: its rows are shuffled


@dataclass(frozen=True, eq=False)
class Measured:
    """Measured pushes, and the support points (k, 3) of those recordings whose names state them, by their number."""

    data: LoadedData
    supports: Mapping[int, Array]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a table for each kind of data and each base."""
    parser = parser_of(__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--kind", choices=sorted(LADDERS))
    parser.add_argument("--base", choices=sorted(BASES))
    options = parser.parse_args(arguments)
    for kind in [options.kind] if options.kind else sorted(LADDERS):
        measured = load(kind, options.data)
        mechanics = fitted(measured)
        for base in [options.base] if options.base else sorted(BASES, reverse=True):
            print(f"\n## {kind}, {base} base\n")
            report(BASES[base](measured), mechanics, measured.data)


def load(kind: str, data: Path) -> Measured:
    """Import and load one kind of measured pushes."""
    with tempfile.TemporaryDirectory() as work:
        loaded = LADDERS[kind](data, Path(work))
        return Measured(loaded, different_supports(sorted(Path(work).glob("*.csv"))))


def mit_square(data: Path, work: Path) -> LoadedData:
    """Load the 3500 windows of the measured square, without the unknown order of its pushes."""
    import_source("mit-square", [data / "mit_square" / "pushes_3500.npz"], work)
    loaded = load_evidence([work / "pushes_3500.csv"])
    known = {name: column for name, column in loaded.table.covariates.items() if name not in ORDER}
    return replace(loaded, table=replace(loaded.table, covariates=known))


def mlab(data: Path, work: Path) -> LoadedData:
    """Load the seven logs of 50 whole pushes of the triangle, on different supports and two surfaces."""
    import_source("mlab", [data / "mlab" / "sensor_log"], work)
    return load_evidence(sorted(work.glob("*.csv")))


LADDERS: dict[str, Callable[[Path, Path], LoadedData]] = {"mit-square": mit_square, "mlab": mlab}


def textbook(measured: Measured) -> PushModel:
    """The textbook model, with the covariance of its residuals on the pushes that are not held out."""
    table = measured.data.table
    return train_model(table.take(~held_out_rows(table)), measured.data.rig, "analytical", name="textbook")


def exact(measured: Measured) -> PushModel:
    """The exact forward model with the textbook's parameters, on the known supports."""
    model, rig = textbook(measured), measured.data.rig
    supports = {number: supported_at(points) for number, points in measured.supports.items()}
    mechanics = FittedMechanics(PushMechanics(rig.outline, rig.pusher_radius, supports=supports))
    return replace(model, name="exact", predictor=predictor_about(mechanics, model.training))


BASES: dict[str, Callable[[Measured], PushModel]] = {"textbook": textbook, "exact": exact}


def fitted(measured: Measured) -> PushModel:
    """Fitted mechanics, on the known supports."""
    table, options = measured.data.table, TrainingOptions(fit=True, supports=measured.supports)
    training = table.take(~held_out_rows(table))
    return train_model(training, measured.data.rig, "analytical", name="fitted mechanics", options=options)


def report(base: PushModel, mechanics: PushModel, data: LoadedData) -> None:
    """Trace the residual, and score base, traced model and fitted mechanics on the held-out pushes."""
    found = trace(base, data)
    table = found.held_out.table
    effects = ", ".join(f"{effect.mechanism or 'unknown'} by {effect.covariate}" for effect in found.terms)
    print(
        f"{len(found.analysis.pushes)} pushes searched, {len(table.pushes)} held out. Found: {effects or 'nothing'}.\n"
    )
    models = {base.name: base, "trace": found.extended or base, mechanics.name: mechanics}
    scores = {name: push_scores(compared(model, table, base.training_mean)) for name, model in models.items()}
    print(ruled(HEAD))
    for name, of in scores.items():
        gains = [difference_by_push(scores[base.name], of, figure).text("+.3f") for figure in (total_nmse, total_nlpd)]
        cells = [by_push(of, total_nmse).text(".3f"), by_push(of, total_nlpd).text(), *gains]
        print(piped([name, *cells]), flush=True)


if __name__ == "__main__":
    main()
