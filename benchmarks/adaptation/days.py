# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The folder of a rig: tables of its windows on Monday and Tuesday, and the model that was trained on Monday's.

before.csv.gz and after_NAME.csv.gz with their NAME.rig.yaml, and deployed.pushmodel.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from benchmarks.adaptation.rigs import CHANGES, MONDAY, Session, write_session_of
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.importers import import_source
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
                cut([bag], table)


def cut(data: Sequence[Path], table: Path) -> None:
    """Write the windows of recordings or tables and the rig of the first."""
    table.parent.mkdir(parents=True, exist_ok=True)
    save_rig(load_rig_for(data[:1]), rig_path(table))
    write_table(table, load_data(data))
    print(table, file=sys.stderr, flush=True)


def cut_all(bags: Path, folder: Path) -> None:
    """Cut before.mcap and every after_NAME.mcap of a folder, or bag folders of these names."""
    for bag in sorted((*bags.glob(f"{MONDAY}*"), *bags.glob(f"{AFTER}*"))):
        table = folder / f"{bag.name.removesuffix('.mcap')}{ENDING}"
        if not table.exists():
            cut([bag], table)


def cut_measured(data: Path, out: Path) -> None:
    """Measured pushes in their order: for each log of mlab the one before it is Monday's; mcube's runs by block."""
    with tempfile.TemporaryDirectory() as work:
        import_source("mlab", [data / "mlab" / "sensor_log"], Path(work))
        logs = sorted(Path(work).glob("*.csv"), key=lambda log: log.stem.partition("_exp_")[2])  # by day and time
        for number, (before, after) in enumerate(pairwise(logs), start=1):
            print(f"mlab_{number}: {before.stem} to {after.stem}", file=sys.stderr)
            _pair([before], [after], out / f"mlab_{number}")
    with tempfile.TemporaryDirectory() as work:
        import_source("mcube", [data / "mcube_preliminary"], Path(work))
        aluminium, steel = (sorted(Path(work).glob(f"{block}_block*")) for block in ("Al", "St"))
        _pair(aluminium, steel, out / "mcube_1")
        _pair(aluminium[:2], aluminium[2:], out / "mcube_2")
        _pair(steel[:2], steel[2:], out / "mcube_3")


def _pair(before: Sequence[Path], after: Sequence[Path], folder: Path) -> None:
    cut(before, folder / f"{MONDAY}{ENDING}")
    cut(after, folder / f"{AFTER}measured{ENDING}")


def train(folder: Path) -> None:
    """Train what `push_predictor train --kind vhgp --mean mechanics` gives on Monday's windows, unless it is there."""
    if not (folder / MODEL).exists():
        monday = folder / f"{MONDAY}{ENDING}"
        table, rig, options = load_data([monday]), load_rig_for([monday]), TrainingOptions(mean="mechanics")
        model = train_model(table, rig, "vhgp", name=folder.name, options=options)
        save_model(model, folder / MODEL)
        print(model, file=sys.stderr, flush=True)


def tuesdays(folder: Path) -> Iterator[tuple[str, LoadedData]]:
    """The changes of a rig and what was recorded after them."""
    names = {path.name[len(AFTER) : -len(ENDING)]: path for path in folder.glob(f"{AFTER}*{ENDING}")}
    for name in sorted(names, key=lambda name: (CHANGES.index(name) if name in CHANGES else len(CHANGES), name)):
        yield name, load_evidence([names[name]])
