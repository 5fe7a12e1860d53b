# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor trace: find what a model fails to explain on new pushes, and extend the model by it."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.common.command import Option, Output, command
from push_predictor.commands.common.options import READING, Reading, data_argument, model_argument, seed_option
from push_predictor.commands.common.output import warn, write_json
from push_predictor.commands.common.progress import progress
from push_predictor.errors import RequestError

if TYPE_CHECKING:
    from push_predictor.residuals.outcome import Trace


@command(
    "trace",
    "Find what a model fails to explain on new pushes and trace it to an effect. Add the effect to the model and "
    "compare before and after on held-out pushes.",
    "push_predictor trace abs.pushmodel bags/new --report trace.html --save-model extended.pushmodel",
    model_argument(),
    data_argument(),
    Option(
        "--covariates", metavar="NAME,...", help="covariates to try, topic:/NAME for a recorded scalar (default: all)"
    ),
    Option("--alpha", type=float, default=0.01, help="family-wise significance level (default %(default)s)"),
    seed_option("the bootstrap"),
    Output("--report", type=Path, metavar="OUT.html", help="write an HTML page with figures"),
    Output(
        "--save-model",
        type=Path,
        metavar="EXTENDED",
        help="write the extended model to this file, if it improves the log density of held-out pushes",
    ),
    *READING,
)
def run(options: argparse.Namespace) -> None:
    """Trace, write JSON and model, print the verdict, then draw the report: what can fail late comes last."""
    from push_predictor.residuals.trace import trace_data

    _check(options)
    names = None if options.covariates is None else _names(options.covariates)
    reading = Reading(options)
    with progress("trace") as watch:
        found = trace_data(
            options.data,
            options.model,
            alpha=options.alpha,
            covariates=names,
            rig=reading.rig,
            seed=options.seed,
            topics=reading.topics,
            watch=watch,
            checks=reading.checks,
        )
    reading.save_topics(options.data)
    saved = False
    try:
        saved = _write_results(options, found)
    finally:
        if options.json != "-":
            _print(found, options.save_model if saved else None)
    _write_report(options, found)


def _check(options: argparse.Namespace) -> None:
    """Raise for all that would fail at the end and can be known before the work."""
    from push_predictor.reporting import html

    if not 0.0 < options.alpha < 1.0:
        raise RequestError("--alpha", options.alpha, "a number above 0 and below 1")
    if options.report is not None:
        html.check_installed("--report")


def _names(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise RequestError("--covariates", text, "names separated by commas")
    return list(dict.fromkeys(names))


def _write_results(options: argparse.Namespace, found: Trace) -> bool:
    """Write JSON and extended model; warn, and return False, if no model was written."""
    from push_predictor.models.store.model_file import save_model
    from push_predictor.residuals.outcome import trace_json

    write_json(options, trace_json(found))
    path = options.save_model
    if path is None:
        return False
    if found.extended is None:
        warn(f"{path} is not written: the motion model did not change (verdict {found.verdict})")
        return False
    path.parent.mkdir(parents=True, exist_ok=True)
    save_model(found.extended, path)
    return True


def _write_report(options: argparse.Namespace, found: Trace) -> None:
    from push_predictor.residuals.reporting.page import write_trace_report

    if options.report is None:
        return
    with progress("trace report"):
        write_trace_report(options.report, found)
    if options.json != "-":
        print(f"report: {options.report}")


def _print(found: Trace, saved: Path | None) -> None:
    """Print the verdict, and where the extended model is."""
    from push_predictor.models.push_model import defaults_in_words
    from push_predictor.residuals.reporting.sentences import summary_lines

    print("\n".join(summary_lines(found)))
    if saved is not None and found.extended is not None:
        needs = ", ".join(found.extended.needs) or "no further covariates"
        defaults = f"; defaults: {defaults_in_words(found.extended)}" if found.extended.defaults else ""
        print(f"extended model: {saved}; requests need {needs}{defaults}")
    sys.stdout.flush()  # the verdict is out before the pictures are drawn
