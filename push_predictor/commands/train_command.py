"""push_predictor train: a model from recordings or tables."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from push_predictor.commands.output import (
    add_command,
    add_rig,
    check_data,
    check_output,
    check_seed,
    progress,
    write_json,
)
from push_predictor.errors import RequestError


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """The sub-command `train`."""
    parser = add_command(
        commands,
        "train",
        "Train a model and save it.",
        "push_predictor train bags/square_abs_train --model vhgp --out square_abs.pushmodel",
    )
    parser.add_argument("data", nargs="+", type=Path, metavar="DATA", help="recordings or push tables")
    parser.add_argument("--model", required=True, choices=("vhgp", "gp", "analytical"), help="which kind")
    parser.add_argument("--n-train", type=int, metavar="N", help="rows, at random; default: all up to 1000, evenly")
    parser.add_argument(
        "--inducing",
        type=int,
        metavar="M",
        help="vhgp: a sparse one with M inducing inputs; default: dense up to 2000 rows, beyond that sparse with 100",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="K", help="of the choice of rows")
    parser.add_argument("--fit", action="store_true", help="analytical: estimate friction and pressure")
    parser.add_argument("--stride", type=float, metavar="S", help="s between window starts; default: end to end")
    parser.add_argument("--name", help="name in the services; default: the file's stem")
    parser.add_argument("--out", required=True, type=Path, metavar="MODEL", help="the model file")
    add_rig(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Load, train, save."""
    from push_predictor.models.store.model_file import save_model
    from push_predictor.models.train import TrainingOptions, inducing_inputs, train_model, training_rows
    from push_predictor.recordings.load import load_data, load_rig_for
    from push_predictor.recordings.windows.push_window import WindowOptions

    check_data(options.data)
    check_seed(options.seed)
    check_output("--out", options.out)
    if options.fit and options.model != "analytical":
        raise RequestError("--fit", options.model, "it with --model analytical only, a learnt model has nothing to fit")
    if options.inducing is not None and (options.model != "vhgp" or options.inducing < 1):
        raise RequestError("--inducing", options.inducing, "a number from 1 on, with --model vhgp only")
    if options.stride is not None and not 0.0 < options.stride < float("inf"):
        raise RequestError("--stride", options.stride, "a number above 0, in s")
    rig = load_rig_for(options.data, options.rig)
    with progress("read"):
        table = load_data(options.data, rig, WindowOptions(stride=options.stride))
    count = len(training_rows(table, options.n_train, options.seed))
    if m := inducing_inputs(options.model, count, options.inducing):
        print(f"train vhgp: a sparse one of {count} windows, by up to {m} inducing inputs", file=sys.stderr)
    with progress(f"train {options.model}"):
        model = train_model(
            table,
            rig,
            options.model,
            name=options.name or options.out.stem,
            sources=[path.name for path in options.data],
            options=TrainingOptions(
                n_train=options.n_train, seed=options.seed, fit=options.fit, inducing=options.inducing
            ),
        )
    save_model(model, options.out)
    result = {
        "model": str(options.out),
        "name": model.name,
        "kind": model.kind,
        "n_train": len(model.training),
        "n_pushes": model.provenance.pushes,
        "n_rows": len(table),
    }
    if not write_json(options, result):
        print(
            f"{options.out}: {model.kind}, {len(model.training)} of {len(table)} windows, {result['n_pushes']} pushes"
        )
