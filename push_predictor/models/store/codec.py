# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The codec of model files: objects from and to JSON and arrays, by the arguments of their constructors.

An object is written as its class and the arguments of its constructor, which are also its attributes. It is read by
their type hints: whatever a file contains, only the classes of `stored` and what their hints allow are constructed.
Arrays of more than a few numbers are written next to the JSON, under the place of their field.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from functools import cache
from inspect import signature
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from push_predictor.models.store.stored import CHOICES, CLASSES, GIVEN, SINGLE, check
from push_predictor.types import Array, IntArray, TextArray

CLASS = "class"
APART = "array"  # in place of an array that is not in the JSON
SMALL = 32  # numbers of an array in the JSON
NAMES = {cls: name for name, cls in CLASSES.items()}
DTYPES: dict[Any, type[np.generic]] = {Array: np.float64, IntArray: np.int64, TextArray: np.str_}
NUMBERS = {int: (int,), float: (int, float), str: (str,), bool: (bool,)}  # what JSON may contain for them


def encode(value: Any, place: str, arrays: dict[str, np.ndarray]) -> Any:
    """The JSON of a value; its larger arrays are added to the arrays, named by their place."""
    if isinstance(value, np.ndarray):
        if 0 < value.size <= SMALL:
            return value.tolist()
        arrays[place] = value.astype(np.int32) if value.dtype.kind == "i" else value
        return APART
    if isinstance(value, Mapping):
        value = list(value.items())
    if isinstance(value, list | tuple):
        return [encode(item, f"{place}.{k}", arrays) for k, item in enumerate(value)]
    cls: type = type(value)
    if cls in NAMES:
        own = {name: _narrowed(cls, name, getattr(value, name)) for name in _hints(cls)}
        return {CLASS: NAMES[cls]} | {name: encode(v, f"{place}.{name}", arrays) for name, v in own.items()}
    if value is None or isinstance(value, str | bool | int | float):
        return value
    raise TypeError(f"{place}: {cls.__name__} is no class of a model file")


@dataclass(frozen=True)
class Reader:
    """Reads values from JSON and arrays. given: arguments of constructors that a file does not contain."""

    arrays: Mapping[str, np.ndarray]
    given: Mapping[tuple[type, str], Any] = field(default_factory=dict)

    def read(self, found: Any, hint: Any, place: str) -> Any:
        """The value of this type. Raises ValueError that names its place, or what the constructor of a class raises."""
        origin, inner = get_origin(hint), get_args(hint)
        if hint in DTYPES:
            return self._array(found, DTYPES[hint], place)
        if origin in (Union, UnionType):
            if found is None and NoneType in inner:
                return None
            return self._one_of([choice for choice in inner if choice is not NoneType], found, place)
        if origin is Literal:
            return found if found in inner else _refuse(place, found, " or ".join(map(repr, inner)))
        if origin is not None and issubclass(origin, Mapping):
            return dict(self.read(found, list[tuple[inner]], place))  # type: ignore[valid-type]  # made at run time
        if origin in (list, tuple):
            items = _listed(found, place)
            hints = [inner[0]] * len(items) if origin is list or inner[-1] is Ellipsis else inner
            if len(items) != len(hints):
                _refuse(place, found, f"a list of {len(hints)}")
            return origin(
                self.read(item, h, f"{place}.{k}") for k, (item, h) in enumerate(zip(items, hints, strict=True))
            )
        if hint in NUMBERS:
            return hint(found) if type(found) in NUMBERS[hint] else _refuse(place, found, hint.__name__)
        return self._object(found, [hint], place)

    def _one_of(self, choices: Sequence[Any], found: Any, place: str) -> Any:
        return self.read(found, choices[0], place) if len(choices) == 1 else self._object(found, choices, place)

    def _object(self, found: Any, hints: Sequence[type], place: str) -> Any:
        choices = [cls for hint in hints for cls in CHOICES.get(hint, (hint,))]
        names = [name for name, cls in CLASSES.items() if cls in choices]
        if not isinstance(found, dict) or found.get(CLASS) not in names:
            _refuse(place, found, f"an object of class {' or '.join(names)}")
        cls, own = CLASSES[found[CLASS]], {name: value for name, value in found.items() if name != CLASS}
        fields = _hints(cls)
        if own.keys() != fields.keys():
            _refuse(place, sorted(own), f"the fields {', '.join(fields)}: train the model again")
        arguments = {name: self.read(own[name], hint, f"{place}.{name}") for name, hint in fields.items()}
        arguments |= {name: value for (owner, name), value in self.given.items() if owner is cls}
        check(cls, arguments, place)
        return cls(**arguments)

    def _array(self, found: Any, dtype: type[np.generic], place: str) -> np.ndarray:
        if isinstance(found, str) and found == APART:
            if place not in self.arrays:
                raise ValueError(f"{place}: the array is missing")
            values = self.arrays[place]
        else:
            values = np.array(_listed(found, place))
        if values.dtype.kind not in {np.float64: "fi", np.int64: "i", np.str_: "U"}[dtype]:
            _refuse(place, values.dtype, f"an array of {dtype.__name__}")
        return values if dtype is np.str_ else np.asarray(values, dtype=dtype)


@cache
def _hints(cls: type) -> dict[str, Any]:
    """Type hints of what is written of a class."""
    hints = get_type_hints(cls if is_dataclass(cls) else cls.__init__)  # type: ignore[misc]  # of a class, not of an instance
    return {name: hints[name] for name in signature(cls).parameters if (cls, name) not in GIVEN}


def _narrowed(cls: type, name: str, value: Any) -> Any:
    """The value in single precision, if that is how it is stored."""
    if (cls, name) not in SINGLE:
        return value
    if isinstance(value, Mapping):
        return {key: column.astype(np.float32) for key, column in value.items()}
    return value.astype(np.float32)


def _listed(found: Any, place: str) -> list[Any]:
    return found if isinstance(found, list) else _refuse(place, found, "a list")


def _refuse(place: str, found: object, accepted: str) -> Any:
    raise ValueError(f"{place}: {str(found)[:60]!r} is not accepted, give {accepted}")
