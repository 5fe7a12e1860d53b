# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes measured by others: the data in a user's folder that the paper's tables can use (docs/results/accuracy.md)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from push_predictor.errors import ImportSourceError
from push_predictor.geometry.shapes import SHAPES
from push_predictor.recordings.importers.mit import (
    MitPlace,
    file_metadata,
    mit_places,
    paths_in,
    read_mit,
    read_places,
)
from push_predictor.recordings.importers.mit_square import read_mit_square, square_rig
from push_predictor.recordings.importers.staging import ImportReport, Notes
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.rig import Rig, save_rig
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.recordings.table_file import write_table
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor_paper.data.corpus import Corpus, Pair, PushSet, bare
from push_predictor_paper.plan import REFERENCE
from push_predictor_paper.work import Work

FEWEST_WINDOWS, FEWEST_PUSHES = 60, 10  # smallest set with a learning curve
SQUARE = "mit_square"
SQUARE_SUFFIXES = (".npz", ".csv.gz", ".csv")  # of several formats of one table the first is read
BATCH = 100  # files
NAMED = 3  # skipped sets that a note names
ACCEPTED = (
    f"{SQUARE}/pushes_*.npz (.csv.gz, .csv), or files of the MIT push data set in folders or zip archives "
    "(motion_surface=..._shape=..._a=0_v=....h5, .hdf5, .json); of each shape on each surface at least "
    f"{FEWEST_WINDOWS} windows of {FEWEST_PUSHES} pushes"
)


@dataclass(frozen=True, eq=False)
class Imported:
    """The windows in some files of one pair. rig: None if no file could be read. notes: of the import."""

    table: PushTable
    rig: Rig | None
    recordings: int
    notes: Notes


@dataclass(frozen=True)
class MitPush:
    """A straight push at constant speed (mm/s); pair: shape and surface; place: its file."""

    pair: Pair
    speed: float
    place: MitPlace


def measured_corpora(folder: Path, work: Work, scratch: Path) -> tuple[Corpus, ...]:
    """Corpora of `mit_square` and of the straight pushes at constant speed of the MIT push data set, if present.

    Of the MIT set scratch receives every pair as a push table with its rig, and what the import repaired and dropped;
    files that have not changed are not imported again (work). Sets with too few pushes for a learning curve are left
    out: the last one's notes say which. Raises ImportSourceError if nothing remains.
    """
    left_out: list[str] = []
    corpora = [*_square_corpora(folder, left_out), *_mit_corpora(folder, work, scratch, left_out)]
    skipped = _skipped(left_out)
    if not corpora:
        raise ImportSourceError(
            f"{folder}: holds nothing that the paper's tables can use{skipped}; accepted: {ACCEPTED}"
        )
    *others, last = corpora
    return (*others, replace(last, notes=(f"{last.title}{skipped}.",))) if skipped else tuple(corpora)


def square_tables(folder: Path) -> list[Path]:
    """The tables of measured windows of a square in a folder, one file of each."""
    inside = folder if folder.name == SQUARE else folder / SQUARE
    every = [path for suffix in SQUARE_SUFFIXES for path in sorted(inside.glob(f"pushes_*{suffix}"))]
    return list({path.name.split(".")[0]: path for path in reversed(every)}.values())


def import_pushes(places: tuple[MitPlace, ...]) -> Imported:
    """The windows in files of one shape on one surface. The notes name files that cannot be read."""
    notes = Notes()
    rig: Rig | None = None
    tables = [windows_to_table([])]
    try:
        for file in read_places(places):
            try:
                recording = read_mit(file, None, notes)
            except ImportSourceError as error:
                notes.dropped.append(f"{error}: file refused")
                continue
            rig = require_rig(recording)
            tables.append(windows_to_table(find_windows(recording, rig)))
    except (ImportSourceError, OSError) as error:
        notes.dropped.append(f"{error}: the files after it in {places[0].path} were skipped")
    return Imported(bare(concatenate(tables)), rig, len(tables) - 1, notes)


def straight_pushes(paths: Sequence[Path], skipped: list[str]) -> list[MitPush]:
    """The straight pushes at constant speed in files and zip archives, each once.

    skipped receives the archives that cannot be read and the shapes of unknown outline. Other files are ignored.
    """
    found: dict[tuple[str, int], MitPush] = {}
    for path in paths:
        try:
            places = mit_places(path)
        except (ImportSourceError, OSError) as error:
            skipped.append(str(error))
            continue
        for place in places:
            if push := _push_at(place):  # a file extracted next to its archive has the same name and size
                found.setdefault((Path(place.name).name, place.size), push)
    unknown = sorted({push.pair[0] for push in found.values()} - set(SHAPES))
    skipped += [f"{shape} (its outline is not known)" for shape in unknown]
    return [push for push in found.values() if push.pair[0] in SHAPES]


def _push_at(place: MitPlace) -> MitPush | None:
    """The push of a file, None for other files and other pushes."""
    try:
        metadata = file_metadata(place.name)
        acceleration, speed = float(metadata["a"]), float(metadata["v"])
    except (ImportSourceError, KeyError, ValueError):
        return None
    if acceleration != 0.0 or speed <= 0.0:
        return None
    return MitPush((metadata["shape"], metadata["surface"]), speed, place)


def _square_corpora(folder: Path, skipped: list[str]) -> Iterator[Corpus]:
    for path in square_tables(folder):
        rig = square_rig()
        pushes = PushSet(bare(read_mit_square(path, rig.outline)), rig)
        name = path.name.split(".")[0]
        if not _enough(pushes):
            skipped.append(f"{SQUARE}/{name} {_too_few(pushes)}")
            continue
        title = (
            f"measured: {SQUARE}/{name}, one side of a square, {len(pushes.table)} overlapping windows of "
            f"{len(pushes.table.pushes)} pushes (the grouping into pushes is an estimate) at 20 mm/s"
        )
        pair = (rig.shape, rig.surface)
        yield Corpus("measured", title, {pair: pushes}, pair)


def _mit_corpora(folder: Path, work: Work, scratch: Path, skipped: list[str]) -> Iterator[Corpus]:
    pushes = straight_pushes(paths_in(folder), skipped)
    sets = _imported_sets(pushes, work, scratch)
    good = {pair: s for pair, s in sets.items() if _enough(s)}
    for pair in sorted({push.pair for push in pushes} - good.keys()):
        skipped.append(f"{pair[0]} on {pair[1]} {_too_few(sets.get(pair))}")
    if good:
        reference = REFERENCE if REFERENCE in good else max(good, key=lambda pair: len(good[pair].table))
        ordered = dict(sorted(good.items(), key=lambda item: item[0] != reference))
        yield Corpus("measured", _mit_title(good, pushes), ordered, reference)


def _imported_sets(pushes: Sequence[MitPush], work: Work, scratch: Path) -> dict[Pair, PushSet]:
    """Import in batches of files, on all cores; write each pair's table and the import's report to scratch."""
    calls, pairs = [], []
    for pair in sorted({push.pair for push in pushes}):
        places = sorted((p.place for p in pushes if p.pair == pair), key=lambda place: place.name)
        for k in range(0, len(places), BATCH):
            calls.append((tuple(places[k : k + BATCH]),))
            pairs.append(pair)
    parts = work.run("measured pushes", import_pushes, calls)
    sets: dict[Pair, PushSet] = {}
    for pair in dict.fromkeys(pairs):
        of_pair = [part for part, p in zip(parts, pairs, strict=True) if p == pair]
        rig = next((part.rig for part in of_pair if part.rig is not None), None)
        if rig is not None:
            sets[pair] = PushSet(concatenate([part.table for part in of_pair]), rig)
    if pushes:
        _keep(scratch, sets, parts)
    return sets


def _keep(scratch: Path, sets: dict[Pair, PushSet], parts: Sequence[Imported]) -> None:
    scratch.mkdir(parents=True, exist_ok=True)
    for pair, pushes in sets.items():
        write_table(scratch / f"{'_'.join(pair)}.csv", pushes.table)
        save_rig(pushes.rig, scratch / f"{'_'.join(pair)}.rig.yaml")
    notes = [part.notes for part in parts]
    messages = [
        tuple(dict.fromkeys(s for n in notes for s in getattr(n, f))) for f in ("dropped", "repaired", "assumed")
    ]
    written = tuple(scratch / f"{'_'.join(pair)}.csv" for pair in sets)
    pushes_found = sum(len(pushes.table.pushes) for pushes in sets.values())
    report = ImportReport("mit", written, sum(part.recordings for part in parts), pushes_found, *messages)
    (scratch / "import.txt").write_text(f"{report}\n", encoding="utf-8")


def _enough(pushes: PushSet) -> bool:
    return len(pushes.table) >= FEWEST_WINDOWS and len(pushes.table.pushes) >= FEWEST_PUSHES


def _too_few(pushes: PushSet | None) -> str:
    if pushes is None:
        return "(no file could be read)"
    return f"(too few; pushes: {len(pushes.table.pushes)}, windows: {len(pushes.table)})"


def _mit_title(sets: Mapping[Pair, PushSet], pushes: Sequence[MitPush]) -> str:
    counts = [len(s.table.pushes) for s in sets.values()]
    speeds = [push.speed for push in pushes if push.pair in sets]
    return (
        f"measured: MIT push data set, your copy: {len(sets)} {'set' if len(sets) == 1 else 'sets'} of "
        f"{_span(counts)} straight pushes at {_span(speeds)} mm/s"
    )


def _span(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _skipped(what: Sequence[str]) -> str:
    if not what:
        return ""
    more = f" and {len(what) - NAMED} more" if len(what) > NAMED else ""
    return f"; skipped: {', '.join(what[:NAMED])}{more}"
