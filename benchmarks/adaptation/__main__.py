# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How fast a model follows a change of its rig.

    python -m benchmarks.adaptation make --out DATA --rigs own:1 points:1 foreign:1
    python -m benchmarks.adaptation cut --bags RIG --out DATA/rig4_1
    python -m benchmarks.adaptation measured --data FOLDER --out DATA
    python -m benchmarks.adaptation run --data DATA --out RESULTS [--methods adapted headed]
    python -m benchmarks.adaptation table --results RESULTS --markdown FILE --json FILE

make: simulate the recordings of rigs, keep their windows and train Monday's model. cut: the same from before.mcap and
after_NAME.mcap of another rig. measured: from mlab and mcube_preliminary in FOLDER, in their order. run: score the
methods on every Tuesday; what is kept is not scored again without --again. table: what the methods gain.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.adaptation.days import MODEL, cut_all, cut_measured, make, train, tuesdays
from benchmarks.adaptation.methods import METHODS, Tuesday
from benchmarks.adaptation.results import Record, load_record, save_record
from benchmarks.adaptation.tables import markdown, rows, seconds, verdict
from push_predictor.models.store.model_file import load_model


def main() -> int:
    """Run one of the commands."""
    options = _parser().parse_args()
    work: Callable[[argparse.Namespace], None] = options.work
    work(options)
    return 0


def _make(options: argparse.Namespace) -> None:
    for rig in options.rigs:
        simulator, _, seed = rig.partition(":")
        make(options.out, simulator, int(seed))
        train(options.out / f"{simulator}_{seed}")


def _cut(options: argparse.Namespace) -> None:
    cut_all(options.bags, options.out)
    train(options.out)


def _measured(options: argparse.Namespace) -> None:
    cut_measured(options.data, options.out)
    for folder in sorted(options.out.glob("m*_*")):
        train(folder)


def _run(options: argparse.Namespace) -> None:
    for folder in sorted(path.parent for path in options.data.glob(f"*/{MODEL}")):
        model = load_model(folder / MODEL)
        for change, loaded in tuesdays(folder):
            path, tuesday = options.out / folder.name / f"{change}.json", Tuesday(model, change, loaded)
            known = load_record(path).methods if path.exists() else {}
            missing = [name for name in options.methods if options.again or name not in known]
            begin = time.process_time()
            known |= {name: METHODS[name](tuesday) for name in missing}
            if missing:
                save_record(path, Record(folder.name, change, tuple(tuesday.pushes), known))
                print(f"{path}: {time.process_time() - begin:.1f} s of CPU", file=sys.stderr, flush=True)


def _table(options: argparse.Namespace) -> None:
    records = [load_record(path) for path in sorted(options.results.glob("*/*.json"))]
    found = rows(records)
    parts = []
    for method in ("adapted", "headed"):
        parts += [f"\n### Targets: {method}\n", *verdict(found, method), "", seconds(records, method)]
    titles = {"after": "After so many pushes", "next": "The next pushes, each predicted before it is seen"}
    for table, title in titles.items():
        for level in ("all", "simulator", "rig"):
            parts += [f"\n### {title}: {level}\n", markdown(found, table, level)]
    options.markdown.write_text("\n".join(parts))
    options.json.write_text(json.dumps(found, indent=1))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.adaptation",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(required=True)
    command = commands.add_parser("make")
    command.set_defaults(work=_make)
    command.add_argument("--out", type=Path, required=True)
    command.add_argument("--rigs", nargs="+", required=True, metavar="SIMULATOR:SEED")
    command = commands.add_parser("cut")
    command.set_defaults(work=_cut)
    command.add_argument("--bags", type=Path, required=True)
    command.add_argument("--out", type=Path, required=True)
    command = commands.add_parser("measured")
    command.set_defaults(work=_measured)
    command.add_argument("--data", type=Path, required=True)
    command.add_argument("--out", type=Path, required=True)
    command = commands.add_parser("run")
    command.set_defaults(work=_run)
    command.add_argument("--data", type=Path, required=True)
    command.add_argument("--out", type=Path, required=True)
    command.add_argument("--methods", nargs="+", choices=tuple(METHODS), default=tuple(METHODS))
    command.add_argument("--again", action="store_true", help="also where scores are kept")
    command = commands.add_parser("table")
    command.set_defaults(work=_table)
    for option in ("results", "markdown", "json"):
        command.add_argument(f"--{option}", type=Path, required=True)
    return parser


if __name__ == "__main__":
    sys.exit(main())
