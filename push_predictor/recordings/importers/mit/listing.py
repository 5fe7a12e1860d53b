"""Which pushes a copy of the MIT push data set holds, by its file names alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from push_predictor.errors import ImportSourceError
from push_predictor.geometry.shapes import SHAPES
from push_predictor.recordings.importers.mit.source import MitPlace, file_metadata, mit_places


@dataclass(frozen=True)
class MitPush:
    """A straight push at constant speed (mm/s) of a shape on a surface, and the file that holds it."""

    pair: tuple[str, str]
    speed: float
    place: MitPlace


def straight_pushes(paths: Sequence[Path], left_out: list[str]) -> list[MitPush]:
    """The straight pushes at constant speed in files and zip archives, each once.

    left_out receives archives that cannot be read and shapes whose outline is not known. Other files are passed over.
    """
    found: dict[tuple[str, int], MitPush] = {}
    for path in paths:
        try:
            places = mit_places(path)
        except (ImportSourceError, OSError) as error:
            left_out.append(str(error))
            continue
        for place in places:
            if push := _push_at(place):  # a file unpacked beside its archive has the same name and length
                found.setdefault((Path(place.name).name, place.size), push)
    unknown = sorted({push.pair[0] for push in found.values()} - set(SHAPES))
    left_out += [f"{shape} (its outline is not known)" for shape in unknown]
    return [push for push in found.values() if push.pair[0] in SHAPES]


def _push_at(place: MitPlace) -> MitPush | None:
    """None for what is no file of the set, or no straight push at constant speed."""
    try:
        metadata = file_metadata(place.name)
        acceleration, speed = float(metadata["a"]), float(metadata["v"])
    except (ImportSourceError, KeyError, ValueError):
        return None
    if acceleration != 0.0 or speed <= 0.0:
        return None
    return MitPush((metadata["shape"], metadata["surface"]), speed, place)
