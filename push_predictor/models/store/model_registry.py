"""The models a server holds: by name, one of them the default. No ROS here."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from push_predictor.errors import ModelFileError, PushPredictorError, RequestError
from push_predictor.models.store.model_file import is_model_file, load_model
from push_predictor.models.tabulated.tabulated_model import TabulatedModel, tabulate
from push_predictor.resources import DEFAULT_MODEL, share_path

SHIPPED = "default"  # stands for the model that ships with the package


class ModelRegistry:
    """Loaded models in the order of their arrival. A model is taken up only when its file has been read whole and its
    table is made, so that it never answers in two ways.
    """

    def __init__(self) -> None:
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
        """What an empty name stands for: the model chosen, else the first; empty where there is none."""
        return self._chosen or next(iter(self._models), "")

    @property
    def accepted(self) -> str:
        """In words, which names a request may give."""
        return f"one of {', '.join(self._models)}" if self._models else "a model; none is loaded"

    def choose_default(self, name: str) -> None:
        """Let an empty name stand for this model, loaded by now or not; empty goes back to the first."""
        self._chosen = name

    def get(self, name: str) -> TabulatedModel:
        """A model by name, the default one for an empty name. Raises RequestError if it is not loaded."""
        model = self._models.get(name or self.default)
        if model is None:
            field, value = ("model", name) if name or not self._chosen else ("default_model", self._chosen)
            raise RequestError(field, value, self.accepted)
        return model

    def load(self, path: Path, name: str = "", *, replace: bool = True) -> str:
        """Load a model file under a name (empty: the one in the file); a model of that name gives way to it.

        Answers the name. Raises ModelFileError, after which the registry is as it was; also for a name that is taken
        if `replace` is false.
        """
        path = _located(path)
        tabulated = _tabulated(path)
        name = name or tabulated.model.name
        if not replace and name in self._models:
            raise ModelFileError(f"{path}: name {name!r} is taken by {self._files[name]}, give it another name")
        # A new dictionary: requests are answered by other threads, which may be going through the old one.
        self._files[name] = path
        self._models = {**self._models, name: tabulated}
        return name

    @property
    def answering(self) -> list[str]:
        """For each model how it answers, a line each."""
        return [f"{name}: {tabulated.how}" for name, tabulated in self._models.items()]

    def load_all(self, places: Iterable[str]) -> list[str]:
        """Load files, folders of files, and for SHIPPED the shipped model.

        Answers what went wrong, a line each; the other models are loaded.
        """
        problems = []
        for index, place in enumerate(places):
            try:
                files = model_files(share_path(*DEFAULT_MODEL) if place == SHIPPED else _located(Path(place)))
            except PushPredictorError as error:
                problems.append(f"models[{index}]: {error}")
                continue
            for path in files:
                problems += self._problem(path)
        return problems

    def describe(self, name: str) -> str:
        """One line of `key=value; ...` about a loaded model: kind, outline, surface, training, covariates, file."""
        model = self._models[name].model
        low, high = float(model.training.duration.min()), float(model.training.duration.max())
        values = {
            "kind": model.kind,
            "outline": model.rig.shape,
            "surface": model.rig.surface,
            "pushes": len(model.training.pushes),
            "windows": len(model.training),
            "covariates": ",".join(model.needs) or "-",  # what a request must bring besides
            "duration": f"{low:g}" if high - low < 1e-6 else f"{low:g}..{high:g}",
            "file": self._files[name],
        }
        return "; ".join(f"{key}={value}" for key, value in values.items())

    def _problem(self, path: Path) -> list[str]:
        try:
            self.load(path, replace=False)
        except PushPredictorError as error:
            return [str(error)]
        return []


def _located(path: Path) -> Path:
    """The absolute path. Raises ModelFileError for one that can lead nowhere."""
    try:
        return path.expanduser().resolve()
    except (OSError, RuntimeError, ValueError) as error:  # no such user, a loop of links, a null character
        raise ModelFileError(f"{str(path)!r}: no such file ({error})") from None


def _tabulated(path: Path) -> TabulatedModel:
    """The model of a file, ready to answer. Raises ModelFileError, whatever the file makes the mathematics do."""
    model = load_model(path)
    try:
        tabulated = tabulate(model)
        # The first prediction fills what is left of caches; no request should wait for that.
        first = model.training.take(np.arange(1))
        tabulated.predict_rows(first.inputs, first.duration, first.covariates)
    except Exception as error:
        raise ModelFileError(f"{path}: the model cannot be served ({type(error).__name__}: {error})") from None
    return tabulated


def model_files(place: Path) -> list[Path]:
    """The file itself, or the model files in a folder, by name. Raises ModelFileError if there is none."""
    try:
        if not place.is_dir():
            return [place]
        files = sorted(path for path in place.iterdir() if path.is_file() and is_model_file(path))
    except OSError as error:
        raise ModelFileError(f"{place}: cannot be read ({error.strerror})") from None
    if not files:
        raise ModelFileError(f"{place}: the folder holds no model file, give one that train wrote")
    return files
