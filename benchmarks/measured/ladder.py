# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What an analytical model lacks on measured pushes: `trace`, and the scores of its effects one after another.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.measured.ladder --data FOLDER [--kind mit-square|mlab] [--base BASE]

FOLDER has mit_square and mlab. `trace` is called as by its command, with the covariates of the data. It holds out a
third of the pushes (residuals/evidence/standardised.py) and uses them once, at the end. BASE is the textbook model (an
ellipsoidal limit surface, contact friction 0.3) or `exact`: the exact forward model with the textbook's parameters and,
where the names of the recordings state them, the support points. No base is fitted, only its covariance is.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.support.scripts import parser_of, piped, ruled
from push_predictor.evaluation.estimate import by_push, difference_by_push, total_nlpd, total_nmse
from push_predictor.evaluation.push_scores import PushScores, push_scores
from push_predictor.models.effects.effect import Effect
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.pressure import supported_at
from push_predictor.models.mechanisms import mechanism_named
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import train_model
from push_predictor.models.train_mechanics import predictor_about
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.load import different_supports
from push_predictor.residuals.candidates.candidate import candidate
from push_predictor.residuals.evidence.loading import LoadedData, load_evidence
from push_predictor.residuals.evidence.standardised import evidence_of, held_out_rows
from push_predictor.residuals.extension.extended_model import extend, refit_base
from push_predictor.residuals.extension.held_out_gain import compared
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.trace import trace
from push_predictor.types import Array

HEAD = ruled("| step | NMSE, dx dy dtheta | NLPD | NMSE minus the step before | NLPD minus the step before |")
ORDER = ("row_id", "push_index")  # meaningless in the square's table: its rows are shuffled


@dataclass(frozen=True, eq=False)
class Measured:
    """Measured pushes, and the support points (k, 3) of those recordings whose names state them, by their number."""

    data: LoadedData
    supports: Mapping[int, Array]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the steps of each trace."""
    parser = parser_of(__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--kind", choices=sorted(LADDERS))
    parser.add_argument("--base", choices=sorted(BASES))
    options = parser.parse_args(arguments)
    for kind in [options.kind] if options.kind else sorted(LADDERS):
        measured = load(kind, options.data)
        for base in [options.base] if options.base else sorted(BASES, reverse=True):
            print(f"\n## {kind}, {base} base\n")
            report(BASES[base](measured), measured.data)


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


def report(base: PushModel, data: LoadedData) -> None:
    """Trace the residual, score the effects one after another on the held-out pushes, and print a row for each."""
    begin = time.process_time()
    found = trace(base, data)
    table = found.held_out.table
    searched, digest = len(found.analysis.pushes), found.held_out.digest[:12]
    print(f"{searched} pushes searched, {len(table.pushes)} held out, sha256 {digest}")
    print(f"trace: {time.process_time() - begin:.0f} CPU s\n\n{HEAD}")
    scores = [push_scores(compared(model, table, base.training_mean)) for model in models_of(found)]
    names = [base.name, *(f"+ {named(effect)}" for effect in found.terms)]
    for before, after, name in zip([None, *scores], scores, names, strict=False):
        print(step_row(before, after, name), flush=True)
    print()
    p_values = {(reported.mechanism, reported.covariate): reported.p_value for reported in found.effects}
    for effect in found.terms:
        p_value = p_values.get((effect.mechanism, effect.covariate))
        text = "not reported" if p_value is None else f"p {p_value:.1g}"
        print("\n  ".join([f"{named(effect)}, {text}", *parameters(effect)]))


def models_of(found: Trace) -> list[PushModel]:
    """The refit, and the models with one effect more each, all effects of a model estimated together."""
    evidence, refit = evidence_of(found.model, found.analysis), refit_base(found.model, found.analysis)
    candidates = [candidate(evidence, effect.mechanism, effect.covariate, effect.basis) for effect in found.terms]
    return [refit, *(extend(refit, evidence, candidates[: k + 1]) for k in range(len(candidates)))]


def named(effect: Effect) -> str:
    """The name of an effect for a reader."""
    return f"{effect.mechanism or 'unknown'} by {effect.covariate} ({effect.basis.name})"


def parameters(effect: Effect) -> list[str]:
    """The coefficients of a mechanism with 95 % intervals; of the generic response only their number."""
    if effect.mechanism is None:
        return [f"{len(effect.coefficients)} coefficients of the generic response"]
    spread = 1.96 * np.sqrt(np.diagonal(effect.covariance))
    mechanism = mechanism_named(effect.mechanism)
    columns = len(effect.coefficients) // len(mechanism.parameters)
    lines = []
    for k, (value, half) in enumerate(zip(effect.coefficients, spread, strict=True)):
        parameter = mechanism.parameters[k // columns]
        interval = f"{value:.4g} ({value - half:.4g} to {value + half:.4g}) {parameter.unit}"
        lines.append(f"{parameter.name}, {_column(effect, k % columns)}: {interval}")
    return lines


def _column(effect: Effect, k: int) -> str:
    k -= effect.basis.offset
    if k < 0:
        return "constant"
    if effect.basis.name == "category":
        return f"{effect.covariate} {effect.basis.levels[k + 1]:g}"
    return f"column {k + 1} of {effect.basis.name}"


def step_row(before: PushScores | None, after: PushScores, name: str) -> str:
    """The row of a step under HEAD, with paired differences from the step before."""
    outputs = " ".join(f"{value:.3f}" for value in after.totals().nmse[0])
    cells = [f"{by_push(after, total_nmse).text('.3f')}, {outputs}", by_push(after, total_nlpd).text()]
    for figure in (total_nmse, total_nlpd):
        cells.append("" if before is None else difference_by_push(before, after, figure).text("+.3f"))
    return piped([name, *cells])


if __name__ == "__main__":
    main()
