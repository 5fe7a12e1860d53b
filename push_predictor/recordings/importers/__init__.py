# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Import other formats as recordings and push tables, with a report of every repair and assumption.

Import `import_source`; each format has a module.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from push_predictor.errors import ImportSourceError
from push_predictor.recordings.importers.mcube import import_mcube
from push_predictor.recordings.importers.mit import import_mit
from push_predictor.recordings.importers.mit_square import import_mit_square
from push_predictor.recordings.importers.mlab import import_mlab
from push_predictor.recordings.importers.rosbag1 import import_rosbag1
from push_predictor.recordings.importers.staging import ImportReport, Staging, staged
from push_predictor.recordings.rig import Rig
from push_predictor.watch import Watch, no_watch

Importer = Callable[[Sequence[Path], Staging, Rig | None], ImportReport]
IMPORTERS: dict[str, Importer] = {
    "mit": import_mit,
    "mit-square": import_mit_square,
    "mlab": import_mlab,
    "mcube": import_mcube,
    "rosbag1": import_rosbag1,
}
KINDS = tuple(IMPORTERS)

__all__ = ["IMPORTERS", "KINDS", "ImportReport", "import_source"]


def import_source(
    kind: str,
    sources: Sequence[Path],
    out: Path,
    rig: Rig | None = None,
    *,
    overwrite: bool = False,
    watch: Watch = no_watch,
) -> ImportReport:
    """Import files or folders of one kind into the folder `out`; either all results are written or none.

    rig replaces the importer's own. overwrite: replace earlier results of the same names. watch: called with the
    share of the files done. Raises ImportSourceError that
    names the file, the line (or row, byte or topic) that cannot be read, and what is accepted.
    """
    if kind not in IMPORTERS:
        raise ImportSourceError(f"kind {kind!r} is not accepted, give one of {', '.join(KINDS)}")
    if not sources:
        raise ImportSourceError(f"import {kind}: no source was given")
    with staged(Path(out), overwrite=overwrite, watch=watch) as staging:
        return IMPORTERS[kind]([Path(source) for source in sources], staging, rig)
