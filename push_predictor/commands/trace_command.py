"""push_predictor trace: the residual loop, from recordings to an extended model."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.output import (
    add_command,
    add_rig,
    check_data,
    check_output,
    check_seed,
    progress,
    warn,
    write_json,
)
from push_predictor.errors import RequestError

if TYPE_CHECKING:
    from push_predictor.residuals.outcome import Trace


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """The sub-command `trace`."""
    parser = add_command(
        commands,
        "trace",
        "Find what a model leaves over on new pushes, trace it to an effect that the model lacks, add the effect, and "
        "measure before and after on pushes held out from the search.",
        "push_predictor trace bags/new --model abs.pushmodel --report trace.html --save-model extended.pushmodel",
    )
    parser.add_argument("data", nargs="+", type=Path, metavar="DATA", help="recordings or push tables")
    parser.add_argument("--model", required=True, type=Path, metavar="MODEL", help="the deployed model")
    parser.add_argument(
        "--covariates", metavar="NAME,...", help="drivers to try, topic:/NAME for a recorded scalar; default: all"
    )
    parser.add_argument("--alpha", type=float, default=0.01, help="family-wise level (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, metavar="K", help="of the bootstrap (default %(default)s)")
    parser.add_argument("--report", type=Path, metavar="OUT.html", help="write a page with pictures")
    parser.add_argument("--save-model", type=Path, metavar="EXTENDED", help="write the extended model, if there is one")
    add_rig(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Trace, write what was asked for, say what was found."""
    from push_predictor.recordings.rig import load_rig
    from push_predictor.residuals.reporting.trace_json import trace_json
    from push_predictor.residuals.trace import trace_data

    if not 0.0 < options.alpha < 1.0:
        raise RequestError("--alpha", options.alpha, "a number above 0 and below 1")
    check_seed(options.seed)
    check_output("--report", options.report)
    check_output("--save-model", options.save_model)
    names = None if options.covariates is None else _names(options.covariates)
    check_data(options.data)
    rig = load_rig(options.rig) if options.rig else None
    with progress("trace"):
        found = trace_data(
            options.data, options.model, alpha=options.alpha, covariates=names, rig=rig, seed=options.seed
        )
        if options.report is not None:
            _write_report(options.report, found)
    saved = _save(options.save_model, found)
    if not write_json(options, trace_json(found)):
        _print(found, options, saved)


def _names(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise RequestError("--covariates", text, "names with commas between them")
    return list(dict.fromkeys(names))


def _write_report(path: Path, found: Trace) -> None:
    from push_predictor.residuals.reporting.page import write_trace_report

    write_trace_report(path, found)


def _save(path: Path | None, found: Trace) -> bool:
    """Save the extended model where there is one; else say so."""
    from push_predictor.models.store.model_file import save_model

    if path is None:
        return False
    if found.extended is None:
        warn(f"{path} is not written: the motion model did not change (verdict {found.verdict})")
        return False
    path.parent.mkdir(parents=True, exist_ok=True)
    save_model(found.extended, path)
    return True


def _print(found: Trace, options: argparse.Namespace, saved: bool) -> None:
    from push_predictor.residuals.reporting.summary import summary_lines

    print("\n".join(summary_lines(found)))
    if options.report is not None:
        print(f"report: {options.report}")
    if saved and found.extended is not None:
        needs = ", ".join(found.extended.needs) or "nothing more"
        print(f"extended model: {options.save_model}; a request must bring {needs}")
