# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The model registry of a server: loaded models by name, one of them the default."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from threading import Lock

from push_predictor.errors import ModelFileError, PushPredictorError, UnknownModelError
from push_predictor.models.push_model import defaults_in_words, mean_in_words
from push_predictor.models.store.model_file import is_model_file
from push_predictor.models.store.table_cache import completed, load_served
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.resources import model_path
from push_predictor.types import Array


class ModelRegistry:
    """Loaded models in the order of loading.

    A model is registered only after its file has been read completely and it has predicted. `complete` adds what makes
    its predictions fast; they change by no more than the tolerances of tabulated_model.
    """

    def __init__(self) -> None:
        self._lock = Lock()  # `complete` runs in another thread than `load`
        self._models: dict[str, TabulatedModel] = {}
        self._files: dict[str, Path] = {}
        self._chosen = ""

    def __len__(self) -> int:
        return len(self._models)

    @property
    def names(self) -> list[str]:
        """Names of the loaded models."""
        return list(self._models)

    @property
    def default(self) -> str:
        """The name that an empty name stands for: the chosen one, else the first; empty if there is none."""
        return self._chosen or next(iter(self._models), "")

    @property
    def accepted(self) -> str:
        """In words, the names that a request may give."""
        return f"one of {', '.join(self._models)}" if self._models else "a model; none is loaded"

    def choose_default(self, name: str) -> None:
        """Make this name the default, loaded yet or not; empty: the first model again."""
        self._chosen = name

    def get(self, name: str) -> TabulatedModel:
        """A model by name, the default one for an empty name. Raises UnknownModelError if it is not loaded."""
        model = self._models.get(name or self.default)
        if model is None:
            field, value = ("model", name) if name or not self._chosen else ("default_model", self._chosen)
            raise UnknownModelError(field, value, self.accepted)
        return model

    def file(self, name: str) -> Path:
        """The file of a loaded model."""
        return self._files[name]

    def load(self, path: Path, name: str = "", *, replace: bool = True, at_once: bool = False) -> str:
        """Load a model file under a name (empty: the name in the file) and return the name.

        It replaces a model of that name, unless `replace` is false. at_once: leave the computation of missing tables to
        `complete`. Raises ModelFileError for a bad file and for a name in use with `replace` false; the registry is
        then unchanged.
        """
        path = _located(model_path(path))
        tabulated = load_served(path, at_once=at_once)
        name = name or tabulated.model.name
        if not replace and name in self._models:
            raise ModelFileError(f"{path}: name {name!r} is already used by {self._files[name]}, give another name")
        self.put(name, tabulated, path)
        return name

    def put(self, name: str, tabulated: TabulatedModel, path: Path) -> None:
        """Register a model under a name, in place of an older one. path: the file that it comes from."""
        with self._lock:
            self._files[name] = path
            self._models = {**self._models, name: tabulated}  # other threads may be iterating over the old one

    def complete(self, cancelled: Callable[[], bool] = lambda: False) -> None:
        """Compute missing tables, which takes some seconds each.

        Models predict as before until theirs is done. cancelled: asked before each model.
        """
        for name, known in self._models.items():
            if cancelled():
                return
            found = completed(known)
            with self._lock:
                if self._models.get(name) is known:  # another one may have taken its name
                    self._models = {**self._models, name: found}

    @property
    def answering(self) -> list[str]:
        """One line per model: from a table or exactly."""
        return [f"{name}: {tabulated.how}" for name, tabulated in self._models.items()]

    def load_all(self, places: Iterable[str], *, at_once: bool = False) -> list[str]:
        """Load files, folders of files and, for `default`, the shipped model; at_once: see `load`.

        Returns one line for each model that could not be loaded; the others are loaded.
        """
        problems = []
        for index, place in enumerate(places):
            try:
                files = model_files(_located(model_path(place)))
            except PushPredictorError as error:
                problems.append(f"models[{index}]: {error}")
                continue
            for path in files:
                try:
                    self.load(path, replace=False, at_once=at_once)
                except PushPredictorError as error:
                    problems.append(str(error))
        return problems

    def describe(self, name: str) -> str:
        """One line of `key=value; ...` about a loaded model: kind, rig, training, mean, covariates, file."""
        model = self._models[name].model
        values = {
            "kind": model.kind,
            "outline": model.rig.shape,
            "surface": model.rig.surface,
            "pushes": len(model.training.pushes),
            "windows": len(model.training),
            "covariates": ",".join(model.needs) or "-",  # that a request must contain
            "defaults": defaults_in_words(model) or "-",  # of covariates that it may omit
            "duration": _durations(model.training.duration),
            "speeds": _speeds(model.training.inputs[:, 0]),
            "mean": mean_in_words(model.predictor),
            "file": self._files[name],
        }
        return "; ".join(f"{key}={value}" for key, value in values.items())


def _speeds(speed: Array) -> str:
    return f"{1e3 * speed.min():.3g}..{1e3 * speed.max():.3g} mm/s" if len(speed) else "none"


def _durations(duration: Array) -> str:
    if not len(duration):
        return "any"
    low, high = float(duration.min()), float(duration.max())
    return f"{low:g}" if high - low < 1e-6 else f"{low:g}..{high:g}"


def _located(path: Path) -> Path:
    """The absolute path. Raises ModelFileError if it cannot be resolved."""
    try:
        return path.expanduser().resolve()
    except (OSError, RuntimeError, ValueError) as error:  # no such user, a loop of links, a null character
        raise ModelFileError(f"{str(path)!r}: no such file ({error})") from None


def model_files(place: Path) -> list[Path]:
    """The file itself, or the model files in a folder, by name. Raises ModelFileError if there is none."""
    try:
        if not place.is_dir():
            return [place]
        files = sorted(path for path in place.iterdir() if path.is_file() and is_model_file(path))
    except OSError as error:
        raise ModelFileError(f"{place}: cannot be read ({error.strerror})") from None
    if not files:
        raise ModelFileError(f"{place}: the folder contains no model file, give one written by `push_predictor train`")
    return files
