# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report of an import, and its results: all are written together, after a failure none is left."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TypeVar

from push_predictor.errors import ImportSourceError
from push_predictor.recordings.bag.writer import check_replaceable, replace_folder
from push_predictor.recordings.rig import Rig, save_rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import write_table
from push_predictor.recordings.write import write_recording
from push_predictor.watch import Watch, no_watch, watched

T = TypeVar("T")


@dataclass
class Notes:
    """Sentences collected while files are read; each names the file, and the line or count."""

    dropped: list[str] = field(default_factory=list)
    repaired: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)

    def assume(self, sentence: str) -> None:
        """Add an assumption once, even if several files share it."""
        if sentence not in self.assumed:
            self.assumed.append(sentence)


@dataclass(frozen=True)
class ImportReport:
    """The result of an import.

    recordings: number of recordings written. pushes: number of pushes known from the format: the rows of a table, one
    for a file with one push, none for a continuous bag, whose windows must be found first.
    """

    kind: str
    written: tuple[Path, ...]
    recordings: int
    pushes: int
    dropped: tuple[str, ...] = ()
    repaired: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()

    def to_json(self) -> dict[str, object]:
        """The report as JSON values."""
        return {**asdict(self), "written": [str(path) for path in self.written]}

    def __str__(self) -> str:
        head = f"import {self.kind}: {self.recordings} recordings, {self.pushes} pushes"
        parts = [("written", [str(path) for path in self.written])]
        parts += [(name, list(getattr(self, name))) for name in ("dropped", "repaired", "assumed")]
        return "\n".join([head, *(line for name, items in parts for line in _listed(name, items))])


def _listed(name: str, items: list[str]) -> list[str]:
    return [f"{name}:", *(f"  - {item}" for item in items)] if items else [f"{name}: nothing"]


class Staging:
    """Results collected in a temporary folder within their destination."""

    def __init__(self, out: Path, folder: Path, *, overwrite: bool = False, watch: Watch = no_watch) -> None:
        self.out, self.folder, self.overwrite, self._watch = out, folder, overwrite, watch
        self.written: list[Path] = []
        self.recordings = 0
        self.pushes = 0

    def in_turn(self, files: Sequence[T]) -> Iterator[T]:
        """The files to import, one after the other; reports the progress."""
        return watched(files, self._watch, "file")

    def recording(self, recording: Recording, pushes: int) -> None:
        """Write a recording to the folder of its name. Raises ImportSourceError if the name is taken."""
        write_recording(self._claimed(recording.name), recording)
        self.recordings += 1
        self.pushes += pushes

    def table(self, name: str, table: PushTable, rig: Rig) -> None:
        """Write NAME.csv and NAME.rig.yaml. Raises ImportSourceError if a name is taken."""
        write_table(self._claimed(f"{name}.csv"), table)
        save_rig(rig, self._claimed(f"{name}.rig.yaml"))
        self.pushes += len(table.pushes)

    def report(self, kind: str, notes: Notes) -> ImportReport:
        """The report of the collected results."""
        sentences = (tuple(notes.dropped), tuple(notes.repaired), tuple(notes.assumed))
        return ImportReport(kind, tuple(self.written), self.recordings, self.pushes, *sentences)

    def _claimed(self, name: str) -> Path:
        target = self.out / name
        if target in self.written:
            raise ImportSourceError(f"{target}: two sources have this output, import them into different folders")
        if target.exists() and not self.overwrite:
            raise ImportSourceError(f"{target} exists already, give another --out, or --force to overwrite it")
        self.written.append(target)
        return self.folder / name


@contextmanager
def staged(out: Path, *, overwrite: bool = False, watch: Watch = no_watch) -> Iterator[Staging]:
    """Collect results and move them to `out` when the block ends; after an error none is kept.

    overwrite: earlier results are replaced; a folder only if it is a bag.
    """
    made = not out.exists()
    folder: Path | None = None
    try:
        out.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=".import-", dir=out))
        staging = Staging(out, folder, overwrite=overwrite, watch=watch)
        yield staging
        for target in staging.written:
            _move(folder / target.name, target)
    except OSError as error:
        raise ImportSourceError(f"{error.filename or out}: {error.strerror or error}") from error
    finally:
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)
        if made and out.is_dir() and not any(out.iterdir()):
            out.rmdir()


def _move(made: Path, target: Path) -> None:
    if made.is_dir():
        check_replaceable(target)
        replace_folder(target, made)
    else:
        os.replace(made, target)


def sources_in(sources: Sequence[Path], *patterns: str) -> list[Path]:
    """The files that were given, and those in given folders (recursive) whose names match a pattern in any case.

    Raises ImportSourceError for what does not exist, and for a folder without such a file.
    """
    found = []
    for source in sources:
        wanted = f"a file or a folder that contains {' or '.join(patterns)}"
        if not source.exists():
            raise ImportSourceError(f"{source}: does not exist, give {wanted}")
        fits = (path for path in source.rglob("*") if any(fnmatchcase(path.name.lower(), each) for each in patterns))
        inside = list(fits) if source.is_dir() else [source]
        if not inside:
            raise ImportSourceError(f"{source}: contains no {' or '.join(patterns)}")
        found += sorted(inside)
    return found


def safe_name(text: str) -> str:
    """`text` with special characters of file systems and shells replaced by '_'."""
    return re.sub(r"[^A-Za-z0-9.=-]+", "_", text).strip("._") or "unnamed"
