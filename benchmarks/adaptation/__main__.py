# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How fast a model follows a change of its rig.

    export OPENBLAS_NUM_THREADS=1
    python -m benchmarks.adaptation make --data DATA [--rigs own:1 points:1] [--bags FOLDER] [--measured FOLDER]
    python -m benchmarks.adaptation run --data DATA --results RESULTS [--methods adapted headed] [--again]
    python -m benchmarks.adaptation table --results RESULTS --out TABLE

make: Monday's models, and the tables of rigs SIMULATOR:SEED, of before.mcap and after_NAME.mcap in a folder, and of
mlab and mcube_preliminary among the measured data. run: score the methods on every Tuesday; what is kept is not scored
again without --again. table: TABLE.md and TABLE.json.
"""

from __future__ import annotations

import argparse
import json
import pickle
import sys
from pathlib import Path

import numpy as np

from benchmarks.adaptation.days import MODEL, cut_measured, cut_rig, make, train, tuesdays
from benchmarks.adaptation.methods import METHODS, Tuesday
from benchmarks.adaptation.tables import Record, markdown, rows, verdict
from benchmarks.support.scripts import parser_of
from push_predictor.models.store.model_file import load_model

TITLES = {"after": "After so many pushes", "next": "The next pushes, each predicted before it is seen"}


def main() -> None:
    """Run one of the commands."""
    parser = parser_of(__doc__)
    parser.add_argument("command", choices=("make", "run", "table"))
    for name in ("data", "results", "out", "measured"):
        parser.add_argument(f"--{name}", type=Path)
    parser.add_argument("--bags", type=Path, nargs="*", default=[])
    parser.add_argument("--rigs", nargs="*", default=[], metavar="SIMULATOR:SEED")
    parser.add_argument("--methods", nargs="+", choices=tuple(METHODS), default=tuple(METHODS))
    parser.add_argument("--again", action="store_true")
    options = parser.parse_args()
    {"make": _make, "run": _run, "table": _table}[options.command](options)


def _make(options: argparse.Namespace) -> None:
    for rig in options.rigs:
        simulator, _, seed = rig.partition(":")
        make(options.data, simulator, int(seed))
    for bags in options.bags:
        cut_rig(options.data, bags)
    if options.measured:
        cut_measured(options.data, options.measured)
    for folder in sorted(options.data.glob("*_*")):
        train(folder)


def _run(options: argparse.Namespace) -> None:
    for folder in sorted(path.parent for path in options.data.glob(f"*/{MODEL}")):
        model = load_model(folder / MODEL)
        for change, loaded in tuesdays(folder):
            path, tuesday = options.results / folder.name / f"{change}.pickle", Tuesday(model, change, loaded)
            known = pickle.loads(path.read_bytes()).methods if path.exists() else {}
            missing = [name for name in options.methods if options.again or name not in known]
            if missing:
                known |= {name: METHODS[name](tuesday) for name in missing}
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(pickle.dumps(Record(folder.name, change, tuple(tuesday.pushes), known)))
                print(path, *missing, file=sys.stderr, flush=True)


def _table(options: argparse.Namespace) -> None:
    records: list[Record] = [pickle.loads(path.read_bytes()) for path in sorted(options.results.glob("*/*.pickle"))]
    found, lines = rows(records), []
    for method in ("adapted", "headed"):
        seconds = np.concatenate([r.methods[method].seconds for r in records])
        cost = f"{1e3 * np.median(seconds):.0f} ms of processor time, at most {1e3 * seconds.max():.0f} ms"
        lines += [f"\n### Targets: {method}\n", *verdict(found, method), f"* an update takes {cost}"]
    for table, title in TITLES.items():
        lines += [f"\n### {title}: {level}\n\n{markdown(found, table, level)}" for level in ("all", "simulator", "rig")]
    options.out.with_suffix(".md").write_text("\n".join(lines))
    options.out.with_suffix(".json").write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
