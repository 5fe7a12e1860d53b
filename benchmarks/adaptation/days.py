# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The folder of a rig: tables of its windows on Monday and Tuesday, and the model that was trained on Monday's.

before.csv.gz and after_NAME.csv.gz with their NAME.rig.yaml, and deployed.pushmodel.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.adaptation.rigs import CHANGES, MONDAY, Session, write_session_of
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.rig import save_rig
from push_predictor.recordings.table_file import rig_path, write_table
from push_predictor.residuals.evidence.loading import LoadedData, load_evidence

AFTER, ENDING, MODEL = "after_", ".csv.gz", "deployed.pushmodel"


def make(out: Path, rig: str, seed: int) -> None:
    """Simulate the recordings of a rig whose tables are missing, and keep their windows."""
    for name in (MONDAY, *(f"{AFTER}{change}" for change in CHANGES)):
        table = out / f"{rig}_{seed}" / f"{name}{ENDING}"
        if not table.exists():
            with tempfile.TemporaryDirectory() as work:
                bag = Path(work) / name
                write_session_of(bag, Session(rig, seed, name.removeprefix(AFTER)))
                cut(bag, table)


def cut(bag: Path, table: Path) -> None:
    """Write the windows of a recording and its rig."""
    table.parent.mkdir(parents=True, exist_ok=True)
    save_rig(load_rig_for([bag]), rig_path(table))
    write_table(table, load_data([bag]))
    print(table, file=sys.stderr, flush=True)


def cut_all(bags: Path, folder: Path) -> None:
    """Cut before.mcap and every after_NAME.mcap of a folder, or bag folders of these names."""
    for bag in sorted((*bags.glob(f"{MONDAY}*"), *bags.glob(f"{AFTER}*"))):
        table = folder / f"{bag.name.removesuffix('.mcap')}{ENDING}"
        if not table.exists():
            cut(bag, table)


def train(folder: Path) -> None:
    """Train what `push_predictor train --kind vhgp --mean mechanics` gives on Monday's windows, unless it is there."""
    if not (folder / MODEL).exists():
        monday, begin = folder / f"{MONDAY}{ENDING}", time.process_time()
        table, rig, options = load_data([monday]), load_rig_for([monday]), TrainingOptions(mean="mechanics")
        save_model(train_model(table, rig, "vhgp", name=folder.name, options=options), folder / MODEL)
        cpu = time.process_time() - begin
        print(f"{load_model(folder / MODEL)!r}\n  {cpu:.0f} s of CPU", file=sys.stderr, flush=True)


def tuesdays(folder: Path) -> Iterator[tuple[str, LoadedData]]:
    """The changes of a rig and what was recorded after them."""
    names = {path.name[len(AFTER) : -len(ENDING)]: path for path in folder.glob(f"{AFTER}*{ENDING}")}
    for name in sorted(names, key=lambda name: (CHANGES.index(name) if name in CHANGES else len(CHANGES), name)):
        yield name, load_evidence([names[name]])
