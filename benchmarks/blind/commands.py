# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The residual loop on recordings whose truth it cannot see.

    python -m benchmarks.blind make --out blind/data --truth blind/truth --seed 1 --count 100
    python -m benchmarks.blind run --data blind/data --out blind/results [--without contact_friction]
    python -m benchmarks.blind oracle --data blind/data --truth blind/truth
    python -m benchmarks.blind removed --data blind/data --truth blind/truth --out blind/removed
    python -m benchmarks.blind score --results blind/results --truth blind/truth [--json FILE] [--markdown FILE]

make: simulate, for each number, a model trained on one recording (only its windows are kept, in the model) and a new
recording. The new one has an effect drawn from benchmarks/blind/effects.py, none, or a change of the wrench only. What
was drawn goes to a separate folder, which `run` does not receive. oracle: the gain of a model with the true mechanism,
driver and form. removed: like run, on the recordings with an effect of the library, each traced without the mechanism
that acts in it, so that it must come back as unknown. run, oracle and removed continue an interrupted run. Results and
truth of a number are JSON files NNN.json. run, oracle and score also accept what `python -m benchmarks.foreign` made.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.blind.effects import GROUPS
from benchmarks.blind.library import library_without
from benchmarks.blind.oracle import oracle_gain
from benchmarks.blind.recordings import MODEL, Size, make_one
from benchmarks.blind.scores import markdown_of, score_of
from benchmarks.support.making import apart
from benchmarks.support.scripts import parser_of
from benchmarks.support.truths import write_truth
from push_predictor.models.train_learnt import MEANS

CYCLE = (*["none"] * 6, *["wrench"] * 2, *["library"] * 7, *["outside"] * 2, *["measurement"] * 2, "variance")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one of the commands."""
    options = _parser().parse_args(arguments)
    work: Callable[[argparse.Namespace], None] = options.work
    work(options)
    return 0


def make(options: argparse.Namespace) -> None:
    """Simulate the recordings and train their models."""
    size = Size(options.training, options.least, options.most, options.rows, options.model, options.mean)
    apart(options.out, options.truth)
    options.truth.mkdir(parents=True, exist_ok=True)
    todo = [(k, size, options) for k in range(options.count) if not _is_made(options, k)]
    _all(_make_kept, todo, options.cores)


def run(options: argparse.Namespace) -> None:
    """Trace every recording; a failed trace is recorded as such."""
    options.out.mkdir(parents=True, exist_ok=True)
    found = sorted(path.name for path in options.data.iterdir() if (path / MODEL).exists())
    todo = [(name, options) for name in found if not (options.out / f"{name}.json").exists()]
    _all(_trace_kept, todo, options.cores)


def oracle(options: argparse.Namespace) -> None:
    """Add the gain of an oracle to every truth."""
    apart(options.data, options.truth)
    every = sorted(options.truth.glob("*.json"))
    _all(_oracle_kept, [(path, options.data) for path in every if _lacks_oracle(path)], options.cores)


def removed(options: argparse.Namespace) -> None:
    """Trace every recording with an effect of the library without that mechanism."""
    apart(options.out, options.truth)
    options.out.mkdir(parents=True, exist_ok=True)
    known = {path.stem: json.loads(path.read_text()) for path in sorted(options.truth.glob("*.json"))}
    acting = {name: truth["names"][0] for name, truth in known.items() if truth["group"] == "library"}
    todo = [
        (name, argparse.Namespace(**{**vars(options), "without": mechanism}))
        for name, mechanism in acting.items()
        if (options.data / name / MODEL).exists() and not (options.out / f"{name}.json").exists()
    ]
    _all(_trace_kept, todo, options.cores)


def score(options: argparse.Namespace) -> None:
    """Print the score; write it to the files of --json and --markdown."""
    truths = {path.stem: json.loads(path.read_text()) for path in sorted(options.truth.glob("*.json"))}
    results = {path.stem: json.loads(path.read_text()) for path in sorted(options.results.glob("*.json"))}
    scored = score_of(truths, results)
    if options.json:
        options.json.write_text(json.dumps(scored, indent=1))
    text = markdown_of(scored)
    if options.markdown:
        options.markdown.write_text(text)
    print(text)


def trace_one(folder: Path, alpha: float, without: str | None) -> dict[str, Any]:
    """The verdict on one recording, and the CPU seconds of the trace."""
    from push_predictor.residuals.outcome import trace_json
    from push_predictor.residuals.trace import trace_data

    begin = time.process_time()
    try:
        with library_without(without):
            verdict = trace_json(trace_data([folder / "new"], folder / MODEL, alpha=alpha))
    except Exception as error:  # a failed trace is a result; the others continue
        verdict = {"failed": f"{type(error).__name__}: {error}"}
    return {**verdict, "seconds": time.process_time() - begin, "without": without}


def _group(seed: int, number: int) -> str:
    """The group of a recording: shares as in CYCLE, order drawn from the seed."""
    turn, place = divmod(number, len(CYCLE))
    return str(np.random.default_rng([seed, turn, 99]).permutation(CYCLE)[place])


def _is_made(options: argparse.Namespace, number: int) -> bool:
    truth, made = options.truth / f"{number:03d}.json", options.out / f"{number:03d}" / MODEL
    return bool(truth.exists() and made.exists())


def _make_kept(number: int, size: Size, options: argparse.Namespace) -> None:
    group = options.group or _group(options.seed, number)
    make_one(number, group, options.seed, size, options.out, options.truth)


def _trace_kept(name: str, options: argparse.Namespace) -> None:
    verdict = trace_one(options.data / name, options.alpha, options.without)
    write_truth(options.out / f"{name}.json", verdict)


def _lacks_oracle(truth: Path) -> bool:
    """Whether a truth has no gain of an oracle, or one of an older version, without that over a trace's reference."""
    known = json.loads(truth.read_text())
    return "oracle_gain" not in known or "traced" not in (known["oracle_gain"] or {"traced": None})


def _oracle_kept(truth: Path, data: Path) -> None:
    known = json.loads(truth.read_text())
    gain = oracle_gain(data / truth.stem / "new", data / truth.stem / MODEL, known)
    write_truth(truth, {**known, "oracle_gain": gain})


def _all(function: Callable[..., None], calls: Sequence[tuple[Any, ...]], cores: int) -> None:
    import joblib

    done = joblib.Parallel(n_jobs=cores, return_as="generator_unordered", batch_size=1)(
        joblib.delayed(function)(*call) for call in calls
    )
    for count, _ in enumerate(done, start=1):
        print(f"\r{count} of {len(calls)}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = parser_of(__doc__)
    commands = parser.add_subparsers(required=True)
    command = _command(commands, "make", make, out="recordings", truth="truth")
    for name, default in (("seed", 1), ("count", 100), ("training", 500), ("least", 170), ("most", 600)):
        command.add_argument(f"--{name}", type=int, default=default)
    command.add_argument("--rows", type=int, default=1000, help="training rows of the model (default %(default)s)")
    command.add_argument("--model", default="vhgp", choices=("vhgp", "gp", "analytical"))
    command.add_argument("--mean", default="auto", choices=MEANS, help="of a learnt model (default %(default)s)")
    command.add_argument("--group", choices=("none", *GROUPS), help="only effects of this group")
    command = _command(commands, "run", run, data="recordings", out="verdicts")
    command.add_argument("--alpha", type=float, default=0.01)
    command.add_argument("--without", metavar="MECHANISM", help="take it out of the library")
    command = _command(commands, "removed", removed, data="recordings", truth="truth", out="verdicts")
    command.add_argument("--alpha", type=float, default=0.01)
    _command(commands, "oracle", oracle, data="recordings", truth="truth")
    command = _command(commands, "score", score, results="verdicts", truth="truth")
    command.add_argument("--json", type=Path)
    command.add_argument("--markdown", type=Path)
    return parser


def _command(
    commands: Any, name: str, work: Callable[[argparse.Namespace], None], **folders: str
) -> argparse.ArgumentParser:
    command: argparse.ArgumentParser = commands.add_parser(name, help=work.__doc__)
    command.set_defaults(work=work)
    command.add_argument("--cores", type=int, default=-1)
    for option, content in folders.items():
        command.add_argument(f"--{option}", type=Path, required=True, metavar="DIR", help=f"folder of the {content}")
    return command
