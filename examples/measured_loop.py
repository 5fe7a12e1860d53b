# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The residual loop on measured pushes, through the real nodes: `python -m examples.measured_loop --data FOLDER`.

FOLDER has mcube_preliminary or mlab, pushes measured by other laboratories. For each split of measured_recordings an
analytical model is trained on the first recordings. Later recordings are replayed: the alarm, the trace, and the
extended model that load_model loads. Recordings that the trace did not use show the error before and after.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from examples.loop import AFTER, BEFORE, ClosedLoop, run_loop
from examples.loop_picture import DEPLOYED, EXTENDED, effect_in_words
from examples.measured_recordings import MCUBE, MLAB, TRACED_SHARE, Split, joined, mcube_splits, mlab_splits
from push_predictor.evaluation.estimate import Estimate, Figure, by_push, difference_by_push, total_nlpd, total_nmse
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.evaluation.validation import Comparison
from push_predictor.models.store.model_file import load_model
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.write import write_recording
from push_predictor.residuals.evidence.loading import load_evidence
from push_predictor.residuals.extension.extended_model import refit_base
from push_predictor.residuals.extension.held_out_gain import compared

OUT = Path(__file__).resolve().parents[1] / "out" / "measured_loop"
VARIABLE = "PUSH_PREDICTOR_MEASURED_DATA"
FOLDERS = {"mcube": MCUBE, "mlab": MLAB}
RATES = {"mcube": (10.0, 10.0), "mlab": (100.0, 100.0)}  # mlab's pushes last 7 s, with pauses of 40 s
REFIT = "refit"  # the deployed model with the covariance of the traced pushes
FIGURES: Mapping[str, Figure] = {"nmse": total_nmse, "nlpd": total_nlpd}
BASE = "textbook"


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the loop did on one split.

    counts: pushes and windows of the training, the traced and the later recordings. alarm: as in validation.json.
    later: by model, predictions of the later recordings.
    """

    split: Split
    counts: Mapping[str, tuple[int, int]]
    alarm: Mapping[str, Any]
    closed: ClosedLoop
    later: Mapping[str, Comparison]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the loops, print a table for each, and write all as JSON. Without the data state so, and return 0 as well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help=f"folder of the measured data (default: the variable {VARIABLE})")
    parser.add_argument("--kind", choices=sorted(FOLDERS), help="one laboratory only")
    parser.add_argument("--only", default="", metavar="TEXT", help="only the loops whose name contains TEXT")
    parser.add_argument(
        "--traced-share", type=float, default=TRACED_SHARE, help=f"share of mlab's pushes to trace ({TRACED_SHARE:g})"
    )
    parser.add_argument("--out", type=Path, default=OUT, help="folder for models, results and measured_loop.json")
    options = parser.parse_args(arguments)
    if not 0.0 < options.traced_share < 1.0:
        parser.error(f"--traced-share {options.traced_share:g}: give a share above 0 and below 1")
    data = options.data or Path(os.environ.get(VARIABLE, "measured_data"))
    kinds = []
    for kind in [options.kind] if options.kind else sorted(FOLDERS):
        if (data / FOLDERS[kind]).is_dir():
            kinds.append(kind)
        else:
            print(_absent(kind, data), flush=True)
    if not kinds:
        return 0
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    outcomes = [
        run_split(split, options.out.absolute(), RATES[kind])
        for kind in kinds
        for split in _splits(kind, data, options.traced_share)
        if options.only in split.name
    ]
    if not outcomes:
        raise SystemExit(f"--only {options.only}: no loop has this text in its name")
    path = options.out / "measured_loop.json"
    path.write_text(json.dumps([to_json(outcome) for outcome in outcomes], indent=1))
    print("\n" + "\n\n".join(to_text(outcome) for outcome in outcomes) + f"\n\nWritten: {path}")
    return 0


def run_split(split: Split, out: Path, rates: tuple[float, float]) -> Outcome:
    """Train the base model, run the nodes, and compare the models on the later recordings."""
    begun = time.monotonic()
    folder = out / split.name.replace(" ", "_")
    folder.mkdir(parents=True, exist_ok=True)
    print(f"\n{split.name}: train an analytical model, replay {rates[0]:g} times faster than recorded.", flush=True)
    recordings = {"training": split.training, "traced": split.traced}
    recordings["whole"] = joined([split.traced, split.later], "whole")
    for name, recording in recordings.items():
        write_recording(folder / name, recording)
    model = folder / f"{BASE}.pushmodel"
    command = [
        "train",
        str(folder / "training"),
        "--kind",
        "analytical",
        "--name",
        BASE,
        "--out",
        str(model),
        "--force",
    ]
    subprocess.run([sys.executable, "-m", "push_predictor.cli", *command], check=True)
    closed = run_loop(model, BASE, folder / "traced", folder / "whole", folder, rates)
    outcome = _outcome(split, closed, model, folder)
    print(f"   Done in {time.monotonic() - begun:.0f} s.", flush=True)
    return outcome


def to_text(outcome: Outcome) -> str:
    """The result of a loop for a reader: what happened, then the error before and after."""
    training, traced, later = (_pushes(*count) for count in outcome.counts.values())
    lines = [
        f"{outcome.split.name}. {_conclusion(outcome)}",
        f"   Known, but hidden from the nodes: {outcome.split.known}.",
        f"   Split: training {training}, traced {traced}, later {later}.",
        f"   Alarm: {_alarm(outcome.alarm)}",
        f"   Trace: {_found(outcome.closed)}",
        f"   {'later pushes':24s}{'NMSE (95 % interval)':28s}NLPD (95 % interval)",
    ]
    rows = {name: _errors(comparison) for name, comparison in outcome.later.items()} | _differences(outcome)
    lines += [
        f"   {name:24s}{row['nmse'].text('.3f'):28s}{row['nlpd'].text('.2f')}".replace("(– to –)", "(one push)")
        for name, row in rows.items()
    ]
    return "\n".join(lines)


def to_json(outcome: Outcome) -> dict[str, Any]:
    """The result of a loop as JSON values; an interval that the pushes do not determine is null."""
    traced = outcome.closed.traced
    return {
        "name": outcome.split.name,
        "conclusion": _conclusion(outcome),
        "known": outcome.split.known,
        "split": {name: {"pushes": count[0], "windows": count[1]} for name, count in outcome.counts.items()},
        "alarm": outcome.alarm,
        "trace": {"failed": outcome.closed.failed} if traced is None else traced.verdict,
        "later": {name: _as_json(_errors(comparison)) for name, comparison in outcome.later.items()},
        "differences": {name: _as_json(row) for name, row in _differences(outcome).items()},
    }


# --- the parts of a loop ----------------------------------------------------------------------------------------


def _splits(kind: str, data: Path, traced_share: float) -> list[Split]:
    if kind == "mlab":
        return mlab_splits(data, traced_share)
    with tempfile.TemporaryDirectory(prefix="measured_loop_") as work:
        return mcube_splits(data, Path(work))


def _outcome(split: Split, closed: ClosedLoop, model: Path, folder: Path) -> Outcome:
    """The models on the later recordings, all with the deployed model's training mean as reference."""
    deployed = load_model(model)
    traced, whole = (load_evidence([folder / name / "pushes.csv"]).table for name in (BEFORE, AFTER))
    later = whole.take(whole.covariates["push_index"] >= closed.story.traced)
    found = {name: replace(c, training_mean=deployed.training_mean) for name, c in closed.story.later.items()}
    refit = compared(refit_base(deployed, traced), later, deployed.training_mean)
    counts = {"training": _count(deployed.training), "traced": _count(traced), "later": _count(later)}
    alarm = json.loads((folder / BEFORE / "validation.json").read_text())["alarm"]
    return Outcome(split, counts, alarm, closed, {DEPLOYED: found.pop(DEPLOYED), REFIT: refit, **found})


def _count(table: PushTable) -> tuple[int, int]:
    return len(table.pushes), len(table)


def _errors(comparison: Comparison) -> dict[str, Estimate]:
    scores = push_scores(comparison)
    return {name: _determined(by_push(scores, figure), comparison) for name, figure in FIGURES.items()}


def _differences(outcome: Outcome) -> dict[str, dict[str, Estimate]]:
    """The extended model minus each of the others, empty without one."""
    if EXTENDED not in outcome.later:
        return {}
    after = outcome.later[EXTENDED]
    return {
        f"{EXTENDED} − {name}": {
            key: _determined(difference_by_push(push_scores(outcome.later[name]), push_scores(after), figure), after)
            for key, figure in FIGURES.items()
        }
        for name in (DEPLOYED, REFIT)
    }


def _determined(estimate: Estimate, comparison: Comparison) -> Estimate:
    """The estimate, without an interval if there is one push only."""
    return estimate if len(set(comparison.push_id)) > 1 else replace(estimate, low=np.nan, high=np.nan)


# --- words ------------------------------------------------------------------------------------------------------


def _absent(kind: str, data: Path) -> str:
    return (
        f"SKIPPED, {kind} WAS NOT RUN: the folder {data / FOLDERS[kind]} is absent. "
        f"Give the folder of the measured data with --data FOLDER, or with the variable {VARIABLE}."
    )


def _conclusion(outcome: Outcome) -> str:
    """Whether the loop helped on the later recordings: the answer that stands first."""
    if outcome.closed.traced is None:
        return "Nothing was found: the trace refused these data."
    if EXTENDED not in outcome.later:
        return "The trace extended no model, so the later pushes are predicted as before."
    gained = {name: row["nlpd"].high < 0.0 for name, row in _differences(outcome).items()}
    if all(gained.values()):
        return "The extended model is better on the later pushes."
    if any(gained.values()):
        return f"On the later pushes only this gain is certain: {', '.join(n for n, yes in gained.items() if yes)}."
    return "The extended model has no certain gain on the later pushes."


def _pushes(count: int, windows: int) -> str:
    return f"{count} push{'es' if count != 1 else ''} ({windows} windows)"


def _alarm(alarm: Mapping[str, Any]) -> str:
    if reason := alarm.get("off"):
        return f"off: {reason}."
    evidence = f"(evidence 10^{alarm['log10_evidence']:.1f})".replace("-", "−")
    if not alarm["fired"]:
        return f"did not fire in {alarm['pushes']} pushes {evidence}."
    return f"fired after {alarm['pushes']} pushes {evidence}."


def _found(closed: ClosedLoop) -> str:
    if closed.traced is None:
        return f"failed: {closed.failed}"
    effects = "; ".join(effect_in_words(effect) for effect in closed.traced.verdict["effects"])
    return f"{closed.traced.verdict['verdict'].replace('_', ' ')}: {effects or 'no effect'}."


def _as_json(row: Mapping[str, Estimate]) -> dict[str, Any]:
    return {name: estimate.json() for name, estimate in row.items()}


if __name__ == "__main__":
    sys.exit(main())
