# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Time of a trace by this checkout and by another one, and whether both say the same.

    python -m benchmarks.blind.trace_time RECORDING... --before CHECKOUT [--markdown FILE]

RECORDING: folders as `python -m benchmarks.blind make` writes them. Each is traced by both checkouts in turn, one
process at a time and on one core. Times are CPU seconds of the trace, reading included and the start of Python not:
the wall time of a busy machine means nothing. Difference: the largest relative one between numbers of both results;
`other` where anything else differs.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from math import isnan
from pathlib import Path
from statistics import median
from typing import Any

HERE = Path(__file__).resolve().parents[2]
SMALL = 1e-3  # numbers below it are compared absolutely
TRACE = (
    "import json, sys; from pathlib import Path; from benchmarks.blind.commands import trace_one; "
    "import push_predictor.residuals.trace; print(json.dumps(trace_one(Path(sys.argv[1]), 0.01, None)))"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Trace all recordings twice and print a row for each."""
    parser = argparse.ArgumentParser(description="CPU time of a trace, by this checkout and by another one.")
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--before", type=Path, required=True, help="another checkout of this repository")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args(arguments)
    lines = ["| recording | verdict | before, s | now, s | ratio | difference |", "|" + " --- |" * 6]
    ratios, seconds = [], []
    for folder in options.recordings:
        before, now = (traced(folder.resolve(), checkout.resolve()) for checkout in (options.before, HERE))
        old, new = float(before.pop("seconds")), float(now.pop("seconds"))
        apart = difference(before, now)
        verdict = now.get("verdict", now.get("failed"))
        how_far = "other" if apart is None else f"{apart:.0e}"
        lines.append(f"| {folder} | {verdict} | {old:.1f} | {new:.1f} | {new / old:.2f} | {how_far} |")
        ratios.append(new / old)
        seconds.append(new)
        print(lines[-1], file=sys.stderr, flush=True)
    lines += ["", f"Now: median {median(seconds):.1f} s, longest {max(seconds):.1f} s, ratio {median(ratios):.2f}."]
    text = "\n".join(lines) + "\n"
    if options.markdown:
        options.markdown.write_text(text)
    print(text)
    return 0


def traced(folder: Path, checkout: Path) -> dict[str, Any]:
    """The verdict of a checkout on a recording, with the CPU seconds of the trace."""
    path = os.pathsep.join([str(checkout), str(checkout / "push_predictor_paper")])
    environment = {**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", TRACE, str(folder)]
    done = subprocess.run(command, cwd=checkout, env=environment, stdout=subprocess.PIPE, check=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def difference(one: object, other: object) -> float | None:
    """The largest relative difference between the numbers of two results; None if anything else differs."""
    if isinstance(one, dict) and isinstance(other, dict):
        return _largest([(one[key], other[key]) for key in one]) if one.keys() == other.keys() else None
    if isinstance(one, list) and isinstance(other, list):
        return _largest(list(zip(one, other, strict=True))) if len(one) == len(other) else None
    if isinstance(one, float) and isinstance(other, float):
        same = one == other or (isnan(one) and isnan(other))
        return 0.0 if same else abs(one - other) / max(abs(one), abs(other), SMALL)
    return 0.0 if one == other else None


def _largest(pairs: Sequence[tuple[object, object]]) -> float | None:
    found = [difference(one, other) for one, other in pairs]
    known = [each for each in found if each is not None]
    return max(known, default=0.0) if len(known) == len(found) else None


if __name__ == "__main__":
    raise SystemExit(main())
