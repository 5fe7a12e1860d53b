"""Many independent pieces of work: over all cores (or a cluster) by joblib, kept on disk, with a progress bar.

What is kept belongs to one state of the library's sources: change a module and its results are made anew.
"""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
import scipy

import push_predictor
from push_predictor.errors import PushPredictorError

Result = TypeVar("Result")
# They change how results look, not what they are.
LOOKS = (
    "push_predictor/evaluation/report/page.py",
    "push_predictor/evaluation/report/tables.py",
    "push_predictor_paper/report.py",
    "push_predictor_paper/section.py",
)
NO_RESULTS = ("reporting", "figures", "nodes", "replay", "online", "commands", "claims", "residuals")


class Watch(Protocol):
    """Sees the work go on: the terminal's progress bar."""

    def begin(self, doing: str, count: int) -> None:
        """A batch of pieces of work begins."""

    def advance(self) -> None:
        """One of them is done."""


class Work:
    """Runs functions of values once: a call that was made before, also by an earlier process, is read from disk.

    folder: where results are kept; cores: how many pieces at once, -1 for all. Under `joblib.parallel_config` with
    another back end (dask, say) the pieces go there; its workers must see the folder. Raises PushPredictorError if
    joblib is not installed.
    """

    def __init__(self, folder: Path, cores: int = -1, watch: Watch | None = None) -> None:
        try:
            import joblib
        except ImportError as error:
            raise PushPredictorError(f"the work needs joblib ({error}); pip install 'push_predictor[report]'") from None
        self._joblib, self._cores, self._watch = joblib, cores, watch
        self.folder = folder / fingerprint()
        self._memory = joblib.Memory(self.folder, verbose=0)

    def run(self, doing: str, function: Callable[..., Result], calls: Sequence[tuple[Any, ...]]) -> list[Result]:
        """Results of function(*arguments) for each call, in their order. The function stands at a module's top."""
        if self._watch is not None:
            self._watch.begin(doing, len(calls))
        kept = self._memory.cache(function)
        parallel = self._joblib.Parallel(n_jobs=self._cores, return_as="generator_unordered", batch_size=1)
        results: dict[int, Result] = {}
        pieces = (self._joblib.delayed(_numbered)(i, kept, arguments) for i, arguments in enumerate(calls))
        for i, result in parallel(pieces):
            results[i] = result
            if self._watch is not None:
                self._watch.advance()
        return [results[i] for i in range(len(calls))]


@cache
def fingerprint() -> str:
    """A digest of the sources on which results depend, and of the versions of numpy and scipy."""
    digest = hashlib.sha256(f"numpy {np.__version__}, scipy {scipy.__version__}".encode())
    for package in (Path(push_predictor.__file__).parent, Path(__file__).parent):
        for path in sorted(package.rglob("*.py")):
            inside = path.relative_to(package.parent)
            if inside.as_posix() not in LOOKS and not set(inside.parts) & set(NO_RESULTS):
                digest.update(inside.as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def _numbered(i: int, function: Callable[..., Result], arguments: tuple[Any, ...]) -> tuple[int, Result]:
    with warnings.catch_warnings():  # that a busy machine takes long to keep arguments is no news to the user
        warnings.filterwarnings("ignore", message="Persisting input arguments")
        return i, function(*arguments)
