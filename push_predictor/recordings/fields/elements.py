# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Elements of arrays, chosen by what is in them: `bodies[name=block].pose` or, by any text, `bodies[block].pose`.

The order and the number of the elements may differ from message to message.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from push_predictor.recordings.bag.message_types import Step
from push_predictor.recordings.fields.columns import Block
from push_predictor.types import BoolArray


def places(block: Block, steps: Sequence[Step], begin: str = "") -> Iterator[tuple[list[str], BoolArray]]:
    """(steps with numbers in their brackets, which of the n messages have the field there) of a field's steps."""
    every = np.ones(len(block.rows), np.bool_)
    if not steps:
        yield [], every
        return
    first, *others = steps
    path = f"{begin}{first.name}"
    elements = _elements(block, path, str(first.choice)) if first.chooses else [(first.text, every)]
    for text, which in elements:
        for further, also in places(block, others, f"{begin}{text}."):
            yield [text, *further], which & also


def names(block: Block, steps: Sequence[Step]) -> set[str]:
    """The texts by which the elements of the first array that is chosen from could be chosen."""
    path = ""
    for step in steps:
        if step.chooses:
            found = [_texts(block, f"{path}{step.name}[{k}]") for k in range(_count(block, f"{path}{step.name}"))]
            return {name for texts in found for text in texts for name in block.text(text)[0]}
        path += f"{step.text}."
    return set()


def _elements(block: Block, path: str, choice: str) -> Iterator[tuple[str, BoolArray]]:
    """(name[number], which messages) of the first element of each message that is chosen."""
    left = np.ones(len(block.rows), np.bool_)
    for number in range(_count(block, path)):
        which = left & _matches(block, f"{path}[{number}]", choice)
        left &= ~which
        if which.any():
            yield f"{path.rpartition('.')[2]}[{number}]", which


def _matches(block: Block, element: str, choice: str) -> BoolArray:
    """Which messages have the wanted text or number in an element."""
    key, given, value = choice.partition("=")
    if f"{element}.{key}" in block.layout.numbers and given:
        return np.asarray(block.number(f"{element}.{key}") == _number(value))
    found = np.zeros(len(block.rows), np.bool_)
    for path in [f"{element}.{key}"] if given else _texts(block, element):
        if path in block.layout.texts:
            texts, number = block.text(path)
            found |= np.array([text == (value if given else choice) for text in texts])[number]
    return found


def _texts(block: Block, element: str) -> list[str]:
    """The paths of the texts in an element, but for those in arrays."""
    start = f"{element}."
    return [path for path in block.layout.texts if path.startswith(start) and "[" not in path[len(start) :]]


def _count(block: Block, path: str) -> int:
    """The number of elements of an array."""
    numbers = {
        int(each[len(path) + 1 :].partition("]")[0])
        for each in (*block.layout.numbers, *block.layout.texts)
        if each.startswith(f"{path}[")
    }
    return len(numbers)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")
