# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The whole workflow: train, predict, replay, validate online, report, close the residual loop. `make demo` runs this.

Three models are trained on one recording. One node then replays another recording, at forty times its speed, on the
topics of a motion tracker and a force sensor. A second node predicts. A third finds the pushes in the topics, requests
predictions and compares them with the outcomes. Last, the rig changes during a replay: the alarm fires, the cause is
traced, and the extended model is loaded (examples/loop.py).
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import textwrap
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from examples import loop
from examples.hidden import make_hidden
from examples.live_table import LiveTable
from examples.overview_picture import readme_picture
from examples.processes import node
from examples.stages import Page, Stages
from push_predictor.evaluation.offline import report_windows, validate_recording
from push_predictor.evaluation.validation import Comparison, metrics_json
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.recordings.windows.push_window import PushWindow, windows_to_table

ROOT = Path(__file__).resolve().parents[1]
TRAINING, HELD_OUT = ROOT / "bags" / "square_abs_train", ROOT / "bags" / "square_abs_test"
OUT = ROOT / "out" / "demo"
KINDS = ("vhgp", "gp", "analytical")  # the first is the main model
RATE = 40.0
AGREEMENT = 1e-9  # m, rad: room for rounding only
SEED = 3  # of the hidden change; `python -m examples.demo 7` draws another one
PATIENCE = 120.0  # s, for the replay and the last predictions
SHARES = (20.0, 20.0, 1.0, *loop.SHARES)  # s of the stages on two idle cores
CONTENTS = """You will see
  - three models learn from a recording of pushes, and predict another one online, in real nodes;
  - their errors with intervals, and a report with figures;
  - a rig that changes while it is watched: an alarm, the search for the cause, the extended model,
    and its error on later pushes.
The paths of all pages and pictures are printed at the end."""


def main(arguments: Sequence[str] = ()) -> int:
    """Run the demo; the exit status is 0 if all nodes worked and online and offline predictions agree.

    arguments: none, or the seed of the hidden change.
    """
    parser = argparse.ArgumentParser(
        prog="python -m examples.demo", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("seed", type=int, nargs="?", default=SEED, help="of the hidden change (default %(default)s)")
    seed = parser.parse_args(arguments).seed
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    OUT.mkdir(parents=True, exist_ok=True)
    print(CONTENTS, flush=True)
    stages = Stages(SHARES)
    # What no node waits for is computed while a core is idle.
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn"), os.nice, (19,)) as beside:
        stages.begin(f"Train {len(KINDS)} models on {TRAINING.relative_to(ROOT)}.")
        hidden = beside.submit(make_hidden, OUT, seed)  # simulated in the meantime; no other part reads it yet
        paths = _trained(KINDS)
        stages.begin(f"Replay {HELD_OUT.relative_to(ROOT)} at {RATE:g} times its speed and validate the models online.")
        print(f"   The nodes run in ROS domain {os.environ['ROS_DOMAIN_ID']}.", flush=True)
        offline = [beside.submit(_offline, path) for path in paths]
        _replay_and_validate(paths)
        stages.begin("Compare the online predictions with offline predictions of the same windows.")
        models = [load_model(path) for path in paths]
        results = [result.result() for result in offline]
        largest = max(_largest_difference(model, k, *results[k]) for k, model in enumerate(models))
        agree = largest <= AGREEMENT
        print(f"   They {'agree' if agree else 'DISAGREE'}: the largest difference is {largest:.1e} m or rad.\n")
        _print_summary([comparison for _, comparison in results])
        change = hidden.result()
        difference = f"predictions differ by at most {largest:.1e} m or rad" if largest else "the same predictions"
        report = beside.submit(_report, models, results, difference)  # drawn in the meantime
        closed = loop.close_the_loop(paths[0], models[0].name, OUT, change, stages)
        pages = [*report.result(), *closed]
    print(f"\nDone in {stages.elapsed:.0f} s. Open:")
    for page, shows in pages:
        print(f"  {page}   {shows}")
    return 0 if agree else 1


def _trained(kinds: Sequence[str]) -> list[Path]:
    """The model files, trained at the same time; an earlier run's file is used unless the recording is newer."""
    paths = [OUT / f"{kind}.pushmodel" for kind in kinds]
    recorded = max(part.stat().st_mtime for part in TRAINING.iterdir())
    training = {}
    for kind, path in zip(kinds, paths, strict=True):
        if path.exists() and path.stat().st_mtime > recorded:
            print(f"   {kind}: using {path.relative_to(ROOT)} of an earlier run")
            continue
        command = ["train", str(TRAINING), "--kind", kind, "--out", str(path), "--force"]
        training[kind] = subprocess.Popen(
            [sys.executable, "-m", "push_predictor.cli", *command],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
    for kind, process in training.items():
        output, _ = process.communicate()
        print(textwrap.indent(output.rstrip(), "   "), flush=True)
        if process.returncode != 0:
            raise SystemExit(f"train --kind {kind} ended with status {process.returncode}")
    return paths


def _replay_and_validate(models: Sequence[Path]) -> None:
    """Run the three nodes until the validator has written its result."""
    result = OUT / "online" / "validation.json"
    result.unlink(missing_ok=True)
    main_model, *others = map(str, models)
    with ExitStack() as running:
        start = running.enter_context
        start(node("predict_server", {"models": [main_model, *others]}))
        validator = {"model": main_model, "compare": others, "output": str(result.parent), "report": False}
        start(node("push_validator", validator))
        table = start(LiveTable())
        replay = {"recording": str(HELD_OUT), "play.rate": RATE, "wait_for_subscribers": 30.0}
        start(node("push_replay", replay))
        deadline = time.monotonic() + PATIENCE
        while not result.exists():
            if time.monotonic() > deadline:
                raise SystemExit(f"the validator wrote no {result} within {PATIENCE:.0f} s: see {OUT}/*.log")
            table.show()
            time.sleep(0.1)


def _offline(path: Path) -> tuple[list[PushWindow], Comparison]:
    """Windows and comparison of a model, without the nodes."""
    return validate_recording(load_model(path), HELD_OUT)


def _largest_difference(model: PushModel, number: int, windows: Sequence[PushWindow], offline: Comparison) -> float:
    """Largest difference between online and offline predictions of a model; infinite if the windows differ."""
    suffix = "" if number == 0 else f"_{model.name}"
    online = json.loads((OUT / "online" / f"windows{suffix}.json").read_text())["windows"]
    if [(w["push_id"], w["window"]) for w in online] != [(w.push_id, w.index) for w in windows]:
        return float("inf")
    return float(np.max(np.abs(np.array([w["predicted"] for w in online]) - offline.mean)))


def _report(
    models: Sequence[PushModel], results: Sequence[tuple[list[PushWindow], Comparison]], agreement: str
) -> list[Page]:
    """Write the report; its pages."""
    comparisons = [comparison for _, comparison in results]
    windows = results[0][0]
    readme_picture(OUT / "overview.png", models[0], windows_to_table(windows))
    facts = {"online and offline": agreement, "replay rate": f"{RATE:g}"}
    alarm = json.loads((OUT / "online" / "validation.json").read_text())["alarm"]
    page = report_windows(models, windows, comparisons, OUT / "report", HELD_OUT.name, facts, alarm)
    fitted = [Page(OUT / f"{kind}.ladder.html", f"how the mechanics under {kind} were fitted") for kind in KINDS]
    return [
        Page(page, "the scores of the three models, with figures"),
        Page(OUT / "overview.png", "predictions and outcomes of single pushes"),
        *(page for page in fitted if page.path.exists()),
    ]


def _print_summary(comparisons: Sequence[Comparison]) -> None:
    """Print the scores of the three models, one line each."""
    scores: list[dict[str, Any]] = [metrics_json(comparison) for comparison in comparisons]
    first = scores[0]
    print(f"   Scores on {first['n_test']} windows of {first['n_pushes']} pushes that no model was trained on.")
    print("   NMSE: 0 is perfect, 3 is no better than the mean outcome in training.")
    print("   NLPD: lower is better (nats per window, SI units).")
    print("   In brackets: 95 % intervals from resampling whole pushes.\n")
    print(f"{'model':12s}{'NMSE':>7s}{'':17s}{'NLPD':>8s}{'':19s}{'95 % coverage: dx':>17s}{'dy':>7s}{'dtheta':>8s}")
    for score in scores:
        spans = {key: score["interval"][key] for key in ("nmse", "nlpd")}
        shares = score["coverage"]["0.95"]
        print(
            f"{score['model']:12s}{score['nmse']['total']:7.3f} {_span(spans['nmse'], 2):16s}"
            f"{score['nlpd']['total']:8.2f} {_span(spans['nlpd'], 2):18s}"
            f"{shares['dx']:17.2f}{shares['dy']:7.2f}{shares['dtheta']:8.2f}"
        )
    print(flush=True)


def _span(interval: dict[str, float], digits: int) -> str:
    return f"({interval['low']:.{digits}f} to {interval['high']:.{digits}f})"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
