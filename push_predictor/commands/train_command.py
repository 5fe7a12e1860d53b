# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor train: train a model from recordings or push tables."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.common.command import Option, command
from push_predictor.commands.common.options import READING, Reading, data_argument, out_option, seed_option
from push_predictor.commands.common.output import check_folder, warn, write_json, write_text
from push_predictor.commands.common.progress import progress
from push_predictor.errors import PushPredictorError, RequestError

if TYPE_CHECKING:
    from push_predictor.models.mechanics.ladder import Rung
    from push_predictor.models.push_model import PushModel
    from push_predictor.recordings.rig import Rig
    from push_predictor.recordings.table import PushTable
    from push_predictor.types import Array

MEANS = ("auto", "mechanics", "zero")
LEARNT = ("vhgp", "gp")
KINDS = ("vhgp", "gp", "analytical", "prior")


def _without_data(options: argparse.Namespace) -> str:
    missing = not options.data and options.kind != "prior"
    return "the following arguments are required: DATA (only --kind prior needs none)" if missing else ""


@command(
    "train",
    "Train a model from recordings or push tables and save it. vhgp learns mean and noise of the outcome, gp the "
    "mean with constant noise. analytical is quasi-static mechanics. prior predicts from outline and priors "
    "before the first push; DATA update it.",
    "push_predictor train bags/square_abs_train --kind vhgp --out square_abs.pushmodel",
    data_argument("*", "; --kind prior needs only --rig"),
    Option("--kind", required=True, choices=KINDS, help="kind of model"),
    Option(
        "--n-train",
        type=int,
        metavar="N",
        help="train on N random windows (default: all; at most 1000, with --fit 4000, spread over all pushes)",
    ),
    Option(
        "--inducing",
        type=int,
        metavar="M",
        help="vhgp: train a sparse model with M inducing inputs (default: dense up to 1000 windows, else M = 100)",
    ),
    Option(
        "--mean",
        choices=MEANS,
        help="vhgp, gp: learn the residual of fitted mechanics (mechanics) or the outcome itself (zero). auto, the "
        "default, takes mechanics unless zero predicts held-out training pushes clearly better",
    ),
    seed_option("--n-train and of the draws of a prior model"),
    Option(
        "--fit",
        action="store_true",
        help="analytical: choose and estimate parameters of friction, pressure, measurement and table",
    ),
    Option("--stride", type=float, metavar="S", help="time between window starts in s (default: the duration)"),
    Option("--name", help="name: of the model in the services (default: the name of the file)"),
    out_option("the model, FILE.pushmodel"),
    *READING,
    wrong_call=_without_data,
)
def run(options: argparse.Namespace) -> None:
    """Check the call, load the data, train the model and save it."""
    from push_predictor.models.store.model_file import save_model
    from push_predictor.models.store.table_cache import keep_tables
    from push_predictor.recordings.load import different_supports, load_data, load_rig_for
    from push_predictor.recordings.table import empty_table
    from push_predictor.recordings.windows.push_window import WindowOptions

    kind = options.kind
    _check(options, kind)
    reading = Reading(options)
    rig, checks = reading.rig or load_rig_for(options.data), reading.checks
    supports = different_supports(options.data) if (options.fit or kind == "prior") and options.rig is None else {}
    windows = WindowOptions(stride=options.stride)
    with progress("read"):
        table, topics = empty_table(), reading.topics
        if options.data:
            table = load_data(options.data, rig, windows, numbered=bool(supports), topics=topics, inspect=checks)
        if kind in LEARNT and options.strict:  # an error comes before the work, a warning with its result
            checks.learnt_from(options.data, table, rig)
        reading.save_topics(options.data)
    model, ladder = _trained(options, kind, table, rig, supports)
    save_model(model, options.out)
    with progress("table for predict_server"):
        keep_tables(model, options.out)
    if kind in LEARNT:
        checks.learnt_from(options.data, table, rig)
    lines = _saved_ladder(model, ladder, options.out)
    result = {
        "model": str(options.out),
        "name": model.name,
        "kind": model.kind,
        "n_train": len(model.training),
        "n_pushes": model.provenance.pushes,
        "n_rows": len(table),
        **({"mean": _mean(model)} if kind in LEARNT else {}),
    }
    if not write_json(options, result):
        used = f"trained on {len(model.training)} of {len(table)} windows, {model.provenance.pushes} pushes"
        about = ", with fitted mechanics as mean" if result.get("mean") == "mechanics" else ""
        print(f"{options.out}: {model.kind}, {used if len(table) else 'from outline and priors alone'}{about}")
        print("\n".join(lines), end="\n" if lines else "")


def _mean(model: PushModel) -> str:
    """The mean function of a learnt model, as in --mean."""
    from push_predictor.models.predictors import GaussianProcessPredictor

    predictor = model.predictor
    return "mechanics" if isinstance(predictor, GaussianProcessPredictor) and predictor.mean is not None else "zero"


def _check(options: argparse.Namespace, kind: str) -> None:
    """Raise RecordingError or RequestError for options that cannot work, before any data are read."""
    if options.fit:
        check_folder(
            "--out", options.out.parent, [path.name for path in _ladder_files(options.out)], force=options.force
        )
    if options.fit and kind != "analytical":
        raise RequestError("--kind", kind, "analytical with --fit (the other kinds have no such choice)")
    if options.mean is not None and kind not in LEARNT:
        raise RequestError("--kind", kind, "vhgp or gp with --mean")
    if options.inducing is not None and kind != "vhgp":
        raise RequestError("--kind", kind, "vhgp with --inducing")
    if options.inducing is not None and options.inducing < 1:
        raise RequestError("--inducing", options.inducing, "an integer of at least 1")
    if options.stride is not None and not 0.0 < options.stride < float("inf"):
        raise RequestError("--stride", options.stride, "a number above 0, in s")


def _trained(
    options: argparse.Namespace, kind: str, table: PushTable, rig: Rig, supports: Mapping[int, Array]
) -> tuple[PushModel, list[Rung]]:
    from push_predictor.models.train import TrainingOptions, inducing_inputs, train_model, training_rows

    count = len(training_rows(table, options.n_train, options.seed))
    if m := inducing_inputs(kind, count, options.inducing):
        print(f"train vhgp: sparse, {count} windows, up to {m} inducing inputs", file=sys.stderr)
    choices = TrainingOptions(
        options.n_train,
        options.seed,
        fit=options.fit,
        inducing=options.inducing,
        supports=supports,
        mean=options.mean or "auto",
    )
    name, sources = options.name or options.out.stem, [path.name for path in options.data]
    ladder: list[Rung] = []
    with progress(f"train {kind}") as watch:
        model = train_model(table, rig, kind, name=name, sources=sources, options=choices, watch=watch, ladder=ladder)
    return model, ladder


def _ladder_files(out: Path) -> tuple[Path, Path]:
    """JSON and page of the ladder, next to the model."""
    return out.parent / f"{out.stem}.ladder.json", out.parent / f"{out.stem}.ladder.html"


def _saved_ladder(model: PushModel, ladder: list[Rung], out: Path) -> list[str]:
    """Save the ladder of fitted mechanics next to the model as JSON and as a page; return it as lines of text."""
    if not ladder:
        return []
    from push_predictor.evaluation.ladder_page import ladder_json, ladder_lines, write_ladder_page
    from push_predictor.evaluation.scored_ladder import score_ladder

    scored = score_ladder(model, ladder)
    numbers, page = _ladder_files(out)
    write_text(numbers, json.dumps(ladder_json(scored), indent=1, allow_nan=False) + "\n")
    try:
        write_ladder_page(page, scored)
    except PushPredictorError as error:
        warn(f"{page}: not written. {error}")
    return [*ladder_lines(scored), f"Ladder: {numbers}, {page}"]
