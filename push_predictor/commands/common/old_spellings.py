# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Old spellings of options: they still work, with a warning on stderr."""

from __future__ import annotations

from collections.abc import Sequence

# {command: {old option: new option, or the arguments that its values are now: the last of these}}
REPLACED = {
    "train": {"--model": "--kind"},
    "suggest": {"--speed": "--speed-range", "--angle": "--angle-range"},
    "trace": {"--model": "MODEL"},
    "report": {"--model": "KIND MODEL..."},
    "doctor": {"--model": "MODEL"},
}


def current_spelling(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """The words of a call in today's spelling, and a warning for each old one.

    A call that has both spellings of an option is not changed, so that the parser refuses it.
    """
    current, warnings = list(words), []
    command = current[0] if current else ""
    for old, new in REPLACED.get(command, {}).items():
        place = _place(current, old)
        if place is None or _place(current, new) is not None:
            continue
        current = _renamed(current, place, new) if new.startswith("--") else _as_arguments(current, place, new)
        warnings.append(f"`{command} {old}` is now `{command} {new}`. The old spelling still works.")
    return current, warnings


def _place(words: Sequence[str], option: str) -> int | None:
    """Where an option is; None if it is absent. Words after -- are no options."""
    end = words.index("--") if "--" in words else len(words)
    return next((k for k in range(end) if words[k].partition("=")[0] == option), None)


def _renamed(words: Sequence[str], place: int, new: str) -> list[str]:
    _, equals, value = words[place].partition("=")
    return [*words[:place], new + equals + value, *words[place + 1 :]]


def _as_arguments(words: Sequence[str], place: int, new: str) -> list[str]:
    """The words with the values of the option at this place moved to the front: to where the arguments `new` end."""
    _, equals, value = words[place].partition("=")
    end = place + 1
    if not equals:
        most = len(words) if new.endswith("...") else min(len(words), place + 2)
        while end < most and not words[end].startswith("-"):
            end += 1
    values = [value] if equals else words[place + 1 : end]
    rest, front = [*words[:place], *words[end:]], len(new.split())
    return [*rest[:front], *values, *rest[front:]]
