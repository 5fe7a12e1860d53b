# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""List the pushes in a copy of the MIT push data set by file names alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from push_predictor.errors import ImportSourceError
from push_predictor.geometry.shapes import SHAPES
from push_predictor.recordings.importers.mit.source import MitPlace, file_metadata, mit_places


@dataclass(frozen=True)
class MitPush:
    """A straight push at constant speed (mm/s); pair: shape and surface; place: its file."""

    pair: tuple[str, str]
    speed: float
    place: MitPlace


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
