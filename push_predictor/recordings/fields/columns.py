# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Columns of fields from CDR messages of any type (XCDR1, either byte order), many messages at a time.

Where a field lies depends only on the lengths of the strings and sequences before it. One message is walked; all
messages that have the same lengths at the same bytes are then read at once, and later ones too.

Elements of arrays may be chosen by what is in them: `bodies[name=block].pose` or, by any text, `bodies[block].pose`.
The order and the number of the elements may differ from message to message.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from push_predictor.recordings.bag.message_types import Field, Step, short_name
from push_predictor.recordings.bag.messages import Messages
from push_predictor.types import Array, BoolArray, IntArray

_PREFIX = 4  # bytes of encapsulation, from which numbers are aligned
_PADDING = 4  # bytes to a multiple of which a message may be filled up
_NUMBERS = {
    **dict.fromkeys(("bool", "byte", "char"), "u1"),
    **{f"{sign}int{bits}": f"{code}{bits // 8}" for sign, code in (("", "i"), ("u", "u")) for bits in (8, 16, 32, 64)},
    "float32": "f4",
    "float64": "f8",
}
NUMBERS = frozenset(_NUMBERS)


@dataclass(frozen=True, eq=False)
class Block:
    """Messages of the same layout: rows (n,) among those given, and their bytes (n, length)."""

    rows: IntArray
    data: NDArray[np.uint8]
    layout: Layout

    def paths(self, prefix: str) -> list[str]:
        """The paths of the numbers at a field or below it, in their order in the message."""
        return [path for path in self.layout.numbers if path == prefix or path.startswith((f"{prefix}.", f"{prefix}["))]

    def number(self, path: str) -> Array:
        """The numbers (n,) of a field; 64-bit integers are rounded."""
        return self.numbers([path])[:, 0]

    def numbers(self, paths: Sequence[str]) -> Array:
        """The numbers (n, k) of k fields, at once where they lie side by side."""
        places = [self.layout.numbers[path] for path in paths]
        (at, code), size = places[0], int(places[0][1][1:])
        if places != [(at + size * k, code) for k in range(len(places))]:
            return np.column_stack([self.number(path) for path in paths])
        column = np.ascontiguousarray(self.data[:, at : at + size * len(paths)])
        with np.errstate(invalid="ignore"):  # widening a signalling NaN
            return np.asarray(column.view(f"{self.layout.order}{code}").astype(np.float64))

    def where(self, which: BoolArray) -> Block:
        """Some of the messages."""
        return self if which.all() else Block(self.rows[which], self.data[which], self.layout)

    def raw_text(self, path: str) -> bytes:
        """The bytes of a text of the first message, with its closing zero."""
        at, length = self.layout.texts[path]
        return self.data[0, at : at + length].tobytes()

    def text(self, path: str) -> tuple[list[str], IntArray]:
        """The different texts of a field, and which of them each of the n messages has."""
        at, length = self.layout.texts[path]
        column = np.ascontiguousarray(self.data[:, at : at + length])
        if not length or (column == column[0]).all():
            return [_decoded(column[0])], np.zeros(len(column), np.int64)
        different, number = np.unique(column, axis=0, return_inverse=True)
        return [_decoded(row) for row in different], number.reshape(-1)


class BlockReader:
    """Reads the top-level fields of messages of one type that the paths of wanted fields begin with."""

    def __init__(self, type_name: str, definitions: Mapping[str, tuple[Field, ...]], wanted: Sequence[str]) -> None:
        self._type, self._definitions = short_name(type_name), definitions
        self._wanted = [re.split(r"[.\[]", path, maxsplit=1)[0] for path in wanted]
        self._known: dict[int, Layout] = {}  # the last one of messages of a length

    def blocks(self, messages: Messages) -> Iterator[Block]:
        """All readable messages; a message that is not readable is in no block."""
        for rows, data in messages.of_equal_length():
            while len(rows):
                try:
                    layout = self._layout(data[0])
                except (ValueError, LookupError, RecursionError):  # also of a type that contains itself
                    rows, data = rows[1:], data[1:]
                    continue
                same = layout.fits(data)
                yield Block(rows[same], data[same], layout)
                rows, data = rows[~same], data[~same]

    def _layout(self, message: NDArray[np.uint8]) -> Layout:
        known = self._known.get(len(message))
        if known is None or not known.fits(message[None])[0]:
            known = Layout(message.tobytes(), self._type, self._definitions, self._wanted)
            self._known[len(message)] = known
        return known


def whole_block(messages: Messages, definitions: Mapping[str, tuple[Field, ...]]) -> Block | None:
    """All fields of the first message, if it is exactly as long as its type; else None."""
    message, kind = messages.buffer[: int(messages.length[0])], short_name(messages.type)
    try:
        layout = Layout(message, kind, definitions, [each.name for each in definitions[kind]])
    except (ValueError, LookupError, RecursionError):
        return None
    if not 0 <= len(message) - layout.end < _PADDING:
        return None
    return Block(np.zeros(1, np.int64), np.frombuffer(message, np.uint8)[None], layout)


class Layout:
    """Where the fields of one message lie, up to the last wanted one, which ends at the byte `end`.

    numbers {path: (byte, type code)}, texts {path: (byte, length)}, lengths: (byte, value) of every length on the way;
    order: of the bytes. Raises ValueError or LookupError for a message that its type does not describe.
    """

    def __init__(
        self, message: bytes, type_name: str, definitions: Mapping[str, tuple[Field, ...]], wanted: Sequence[str]
    ) -> None:
        if len(message) < _PREFIX or message[0] != 0 or message[1] not in (0, 1):
            raise ValueError("not XCDR1")
        self.order, self.end = "<" if message[1] else ">", _PREFIX
        self.numbers: dict[str, tuple[int, str]] = {}
        self.texts: dict[str, tuple[int, int]] = {}
        self.lengths: list[tuple[int, int]] = []
        self._message, self._definitions = message, definitions
        fields = definitions[type_name]
        last = max(number for number, each in enumerate(fields) if each.name in wanted)
        for each in fields[: last + 1]:
            self._add(each, each.name)

    def fits(self, data: NDArray[np.uint8]) -> BoolArray:
        """Which messages (n, length) have this layout."""
        same = (data[:, 0] == 0) & (data[:, 1] == (self.order == "<"))
        for at, value in self.lengths:
            same &= np.ascontiguousarray(data[:, at : at + 4]).view(f"{self.order}u4")[:, 0] == value
        return np.asarray(same)

    def _add(self, each: Field, path: str) -> None:
        if each.array is None:
            self._add_value(each.type, path)
            return
        count = each.array or self._length()
        if count > len(self._message):
            raise ValueError(f"{path} has {count} elements")
        if count and (code := _NUMBERS.get(each.type)):
            size = int(code[1:])
            at = self._take(size, size * count)
            self.numbers |= {f"{path}[{k}]": (at + size * k, code) for k in range(count)}
            return
        for number in range(count):
            self._add_value(each.type, f"{path}[{number}]")

    def _add_value(self, kind: str, path: str) -> None:
        if code := _NUMBERS.get(kind):
            self.numbers[path] = (self._take(int(code[1:]), int(code[1:])), code)
        elif kind == "string":
            length = self._length()
            self.texts[path] = (self._take(1, length), length)
        else:
            for each in self._definitions[kind]:
                self._add(each, f"{path}.{each.name}")
            if not self._definitions[kind]:
                self._take(1, 1)  # an empty message has one byte in CDR

    def _length(self) -> int:
        at = self._take(4, 4)
        value = int.from_bytes(self._message[at : at + 4], "little" if self.order == "<" else "big")
        self.lengths.append((at, value))
        return value

    def _take(self, size: int, length: int) -> int:
        """Where `length` bytes aligned to `size` begin."""
        at = _PREFIX + -(-(self.end - _PREFIX) // size) * size
        self.end = at + length
        if self.end > len(self._message):
            raise ValueError("the message is too short")
        return at


def _decoded(row: NDArray[np.uint8]) -> str:
    return row.tobytes().rstrip(b"\0").decode(errors="replace")


# --- chosen elements of arrays ----------------------------------------------------------------------------------------


def places_of(block: Block, steps: Sequence[Step], begin: str = "") -> Iterator[tuple[list[str], BoolArray]]:
    """(steps with numbers in their brackets, which of the n messages have the field there) of a field's steps."""
    every = np.ones(len(block.rows), np.bool_)
    if not steps:
        yield [], every
        return
    first, *others = steps
    path = f"{begin}{first.name}"
    elements = _elements(block, path, str(first.choice)) if first.chooses else [(first.text, every)]
    for text, which in elements:
        for further, also in places_of(block, others, f"{begin}{text}."):
            yield [text, *further], which & also


def element_names(block: Block, steps: Sequence[Step]) -> set[str]:
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
