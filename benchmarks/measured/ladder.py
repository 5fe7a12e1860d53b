"""What the textbook model lacks on measured pushes: the residual loop's search, step by step.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.measured.ladder --data FOLDER [--kind mit-square|mlab] [--quick]

FOLDER has mit_square and mlab. A third of the pushes (residuals/evidence/split.py) is held out and used once, at the
end, for all steps together. A third of the others is the gate. A step is the search on the rest with family-wise level
0.05. Its best candidate enters the model if its parameter is plausible for a rig and if the density at the gate
improves with 95 % confidence. Otherwise it is noted and not tried again. The ladder ends when nothing is significant.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from push_predictor.evaluation.estimate import by_push, total_nlpd, total_nmse
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.models.effects.effect import Effect, mechanism_named
from push_predictor.models.mechanisms import LIBRARY
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import train_model
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import Candidate, candidate
from push_predictor.residuals.candidates.enumeration import candidates_of
from push_predictor.residuals.evidence.drivers import driver_names
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.loading import LoadedData, load_evidence
from push_predictor.residuals.evidence.split import digest_of, held_out_rows
from push_predictor.residuals.evidence.standardised import evidence_of
from push_predictor.residuals.extension.extended_model import extend
from push_predictor.residuals.extension.held_out_gain import compared, gain
from push_predictor.residuals.outcome import Gain
from push_predictor.residuals.selection.forward_selection import search
from push_predictor.residuals.selection.term_choice import SelectedTerm
from push_predictor.types import Array

ALPHA = 0.05  # of a step; the gate rejects false positives
MOST_TRIES = 12
NO_LEVEL = -1.0  # of a category
Label: TypeAlias = tuple[str | None, str]
HEAD = """| step | NMSE, dx dy dtheta | NLPD | NMSE minus the step before | NLPD minus the step before |
|---|---|---|---|---|"""
ORDER = ("row_id", "push_index")  # meaningless in the square's table: its rows are shuffled


@dataclass(frozen=True, eq=False)
class Step:
    """A step of the ladder, accepted or refused.

    model: with the effect; effect: None for the first step. at_gate: gain in NLPD at the gate. refused: the reason,
    empty if accepted.
    """

    model: PushModel
    effect: Effect | None
    p_value: float
    rivals: tuple[str, ...] = ()
    at_gate: Gain | None = None
    refused: str = ""


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the ladders."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--kind", choices=sorted(LADDERS))
    parser.add_argument("--quick", action="store_true", help="two tries at most")
    options = parser.parse_args(arguments)
    for kind in [options.kind] if options.kind else sorted(LADDERS):
        with tempfile.TemporaryDirectory() as work:
            loaded = LADDERS[kind](options.data, Path(work))
        print(f"\n## {kind}\n")
        report(loaded, 2 if options.quick else MOST_TRIES)


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


def report(loaded: LoadedData, most_tries: int = MOST_TRIES) -> None:
    """Run the ladder, score all steps on the held-out pushes, and print a row per step."""
    aside = held_out_rows(loaded.table)
    table, held = loaded.table.take(~aside), loaded.table.take(aside)
    print(f"{len(table.pushes)} pushes for the search, {len(held.pushes)} held out, sha256 {digest_of(held)[:12]}")
    print(f"drivers: {', '.join(names_of(loaded))}\n", flush=True)
    tried = climb(loaded, most_tries)
    print(HEAD)
    rungs = [step for step in tried if not step.refused]
    for before, step in zip([rungs[0], *rungs], rungs, strict=False):
        print(_row(before, step, held, rungs[0].model.training_mean))
    for step in tried[1:]:
        print(_detail(step))


def names_of(loaded: LoadedData) -> list[str]:
    """Names of the drivers that are tried."""
    return driver_names(loaded.table)


def climb(loaded: LoadedData, most_tries: int = MOST_TRIES) -> list[Step]:
    """The steps that were tried, from the textbook model on, without the held-out pushes."""
    table = loaded.table.take(~held_out_rows(loaded.table))
    at_gate = held_out_rows(table)
    rest, gate = table.take(~at_gate), table.take(at_gate)
    model = train_model(rest, loaded.rig, "analytical", name="textbook")
    tried, refused = [Step(model, None, 1.0)], set[Label]()
    while len(tried) <= most_tries:
        found = _suspect(model, rest, names_of(loaded), refused)
        if found is None:
            break
        step = _judged(model, found, rest, gate)
        if found.best.label not in refused:
            tried.append(step)
        if not step.refused:
            model = step.model
        else:
            refused |= {found.best.label} if found.best.label not in refused else _all_by(found.best.covariate)
    return tried


def _suspect(model: PushModel, table: PushTable, names: Sequence[str], refused: Set[Label]) -> SelectedTerm | None:
    """The candidate with the largest gain, constant or with a driver, except for refused ones."""
    evidence, inputs = evidence_of(model, table), inputs_basis(model, table)
    candidates = [_of_all_levels(c, table) for c in candidates_of(evidence, names, inputs) if c.label not in refused]
    found: list[SelectedTerm] = []
    for constant in (True, False):
        chosen = [c for c in candidates if (c.basis.name == "constant") == constant]
        if chosen:
            found += search(evidence, chosen, inputs, ALPHA / 2.0, most_terms=1).terms
    return max(found, key=lambda term: term.rivals[0].gain, default=None)


def _all_by(covariate: str) -> Set[Label]:
    """Labels of all mechanisms with this driver; used when the generic response was refused twice."""
    return {(None, covariate), *((mechanism.name, covariate) for mechanism in LIBRARY)}


def _of_all_levels(candidate: Candidate, table: PushTable) -> Candidate:
    """The candidate with one coefficient for every level; the textbook model has no reference level."""
    if candidate.basis.name != "category":
        return candidate
    basis = replace(candidate.basis, levels=(NO_LEVEL, *candidate.basis.levels))
    return replace(candidate, basis=basis, values=basis.values(table.covariates, len(table)))


def _judged(model: PushModel, found: SelectedTerm, rest: PushTable, gate: PushTable) -> Step:
    best = found.best
    evidence = evidence_of(model, rest)
    after = extend(model, evidence, [candidate(evidence, best.mechanism, best.covariate, best.basis)])
    effect, (_, nlpd) = after.predictor.effects[-1], gain(model, after, gate)
    refused = "" if nlpd.high < 0.0 else "no gain at the gate"
    if not _plausible(effect, rest):
        refused = "implausible parameter"
    others = dict.fromkeys(_label(*rival.candidate.label) for rival in found.rivals)
    others.pop(_label(*best.label), None)
    return Step(after, effect, found.p_value, tuple(others), nlpd, refused)


def _plausible(effect: Effect, table: PushTable) -> bool:
    """Whether the parameters are plausible for a rig at all of these windows."""
    if effect.mechanism is None:
        return True
    mechanism = mechanism_named(effect.mechanism)
    values = effect.basis.values(table.covariates, len(table))
    return mechanism.plausible(values @ effect.coefficients.reshape(len(mechanism.parameters), -1).T)


def _row(before: Step, step: Step, held: PushTable, reference: Array) -> str:
    sums = push_scores(compared(step.model, held, reference))
    outputs = " ".join(f"{value:.3f}" for value in sums.totals().nmse[0])
    errors = f"{by_push(sums, total_nmse).text('.3f')}, {outputs} | {by_push(sums, total_nlpd).text()}"
    changes = [""] * 2 if step is before else [_interval(g) for g in gain(before.model, step.model, held, reference)]
    return f"| {named(step)} | {errors} | {' | '.join(changes)} |"


def _detail(step: Step) -> str:
    assert step.effect is not None
    assert step.at_gate is not None
    fate = f"refused: {step.refused}" if step.refused else "accepted"
    evidence = (
        f"p {step.p_value:.4f}, NLPD at the gate {_interval(step.at_gate)}; rivals: {', '.join(step.rivals) or 'none'}"
    )
    return "\n  ".join([f"\n{named(step)}, {fate}; {evidence}", *parameters(step.effect)])


def named(step: Step) -> str:
    """The name of the step for a reader."""
    if step.effect is None:
        return "textbook"
    return f"{_label(step.effect.mechanism, step.effect.covariate)} ({step.effect.basis.name})"


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
    if effect.basis.name == "category":
        return f"{effect.covariate} {effect.basis.levels[k + 1]:g}"
    return f"column {k + 1} of {effect.basis.name}"


def _label(mechanism: str | None, covariate: str) -> str:
    return f"{mechanism or 'unknown'} by {covariate}"


def _interval(gain: Gain) -> str:
    return f"{gain.value:+.3f} ({gain.low:+.3f} to {gain.high:+.3f})"


if __name__ == "__main__":
    main()
