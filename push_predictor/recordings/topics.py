# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The topics of a recording's streams: given by the caller, or saved in NAME.recording.yaml next to the bag."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from push_predictor.errors import RecordingError, RequestError
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.fields.pose_rows import UP_AXES, Z_UP

ENDING = ".recording.yaml"
STREAMS = ("slider", "pusher", "wrench")
WORLD_AXES, TIP_AXES = "world", "tip"
FREE_MOTION, NO_BIAS = "free_motion", "none"
NO_WRENCH = "none"  # in place of a topic: contact from geometry alone
BIASES = (FREE_MOTION, NO_BIAS)
HEADER_STAMPS, LOG_STAMPS = "header", "log"
STAMPS = (HEADER_STAMPS, LOG_STAMPS)
UP = f"{', '.join(UP_AXES[:-1])} or {UP_AXES[-1]}, of some streams STREAM=AXIS,STREAM=AXIS"
ANOTHER_BODY = "another than slider_topic (--slider-topic, --pusher-topic): slider and tip would have the same poses"
_FIELDS = {  # of Topics, by their names in NAME.recording.yaml, as parameters and as options
    **{f"{name}_topic": name for name in STREAMS},
    "covariate_topics": "covariates",
    "wrench_frame": "wrench_frame",
    "wrench_bias": "wrench_bias",
    "world_frame": "world",
    "stamp": "stamp",
    "up": "up",
}
KEYS = tuple(_FIELDS)


@dataclass(frozen=True)
class Topics:
    """Where the streams of a recording are (docs/reference/recordings.md); '' and () mean: not given.

    slider, pusher and wrench are topics; a leading slash makes no difference. `TOPIC.FIELD` names a field of another
    type, `/tf:FRAME` a frame; the wrench `none` leaves a recorded one out. covariates: further scalars, each a topic or
    TOPIC.FIELD. world: the frame in which poses from tf are given, and into which tf turns other poses. wrench_frame:
    the axes of the wrench, `world`, `tip`, or a frame in tf. wrench_bias: `free_motion` to estimate and subtract it,
    `none` not to. stamp: `header`, or `log` for the time at which messages were recorded or received. up: the axis of
    the world that points up, as in `y`, or of single streams, as in `slider=y,wrench=y`. Raises RequestError for other
    values, and for slider and pusher from one place.
    """

    slider: str = ""
    pusher: str = ""
    wrench: str = ""
    covariates: tuple[str, ...] = ()
    world: str = ""
    wrench_frame: str = ""
    wrench_bias: str = ""
    stamp: str = ""
    up: str = ""

    def __post_init__(self) -> None:
        if self.wrench_bias not in ("", *BIASES):
            raise RequestError("wrench_bias", self.wrench_bias, " or ".join(BIASES))
        if self.stamp not in ("", *STAMPS):
            raise RequestError("stamp", self.stamp, " or ".join(STAMPS))
        if self.up and not all(axis in UP_AXES and stream in ("", *STREAMS) for stream, axis in self._ups):
            raise RequestError("up", self.up, UP)
        one, other = (given.replace(":/", ":").strip("/") for given in (self.slider, self.pusher))
        if one and one == other:
            raise RequestError("pusher_topic", self.pusher, ANOTHER_BODY)

    @property
    def wrench_axes(self) -> str:
        """`world`, `tip`, or '' where the wrench has the axes of `wrench_tf_frame`."""
        given = self.wrench_frame or WORLD_AXES
        return given if given in (WORLD_AXES, TIP_AXES) else ""

    @property
    def wrench_tf_frame(self) -> str:
        """The frame in tf whose axes the wrench has, '' without one; `/tf:tip` is a frame, `tip` is not."""
        return "" if self.wrench_axes else self.wrench_frame.rpartition(":")[2].strip("/")

    @property
    def from_log(self) -> bool:
        """Whether samples have the time at which their messages were recorded or received."""
        return self.stamp == LOG_STAMPS

    def up_of(self, stream: str) -> str:
        """The axis that points up in the world of a stream. An axis for all is that of the poses."""
        given = dict(self._ups)
        return given.get(stream, Z_UP if stream == "wrench" else given.get("", Z_UP))

    @property
    def _ups(self) -> list[tuple[str, str]]:
        """(stream, axis) of each part of `up`, '' for all poses."""
        parts = [part.strip().rpartition("=") for part in self.up.split(",") if part.strip()]
        return [(stream.strip(), axis.strip()) for stream, _, axis in parts]

    def over(self, other: Topics) -> Topics:
        """These topics, and those of another where these are not given."""
        return replace(other, **{key: value for key, value in vars(self).items() if value})


def topics_of(values: Mapping[str, Any]) -> Topics:
    """The topics that parameters, options or saved keys name, by KEYS; other names are ignored."""
    given: dict[str, Any] = {name: values[key] for key, name in _FIELDS.items() if values.get(key)}
    return Topics(**given | {"covariates": tuple(given.get("covariates", ()))})


def values_of(topics: Topics) -> dict[str, str | list[str]]:
    """The inverse of topics_of; what is not given is empty."""
    found = {key: getattr(topics, name) for key, name in _FIELDS.items()}
    return {key: list(value) if isinstance(value, tuple) else value for key, value in found.items()}


DEFAULT_TOPICS = Topics("slider/pose", "pusher/pose", "pusher/wrench")


def topics_path(recording: Path) -> Path:
    """NAME.recording.yaml for the folder NAME or the file NAME.mcap."""
    path = Path(os.path.abspath(recording))
    return path.with_name(f"{path.name if path.is_dir() else path.stem}{ENDING}")


def load_topics(recording: Path) -> Topics:
    """The topics saved next to a recording, none without a file.

    Raises RecordingError that names file, key, value and what is accepted.
    """
    import yaml

    path = topics_path(recording)
    if not path.is_file():
        return Topics()
    try:
        saved = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise RecordingError(f"{path}: cannot be read ({' '.join(str(error).split())})") from None
    return _parsed(saved, path)


def save_topics(recording: Path, topics: Topics) -> Path:
    """Save topics next to a recording and return the file's path. Raises OSError that names the path."""
    import yaml

    content = {key: value for key, value in values_of(topics).items() if value}
    path = topics_path(recording)
    write_whole(path, yaml.safe_dump(content, sort_keys=False).encode())
    return path


def _parsed(saved: object, path: Path) -> Topics:
    if not isinstance(saved, dict):
        raise RecordingError(f"{path}: contains {saved!r}, give the keys {', '.join(KEYS)}")
    if unknown := [key for key in saved if key not in KEYS]:
        raise RecordingError(f"{path}: key {unknown[0]!r} is not accepted, give {', '.join(KEYS)}")
    read = {key: _list if key == "covariate_topics" else _text for key in KEYS}
    try:
        return topics_of({key: read[key](value, path, key) for key, value in saved.items()})
    except RequestError as error:
        raise RecordingError(f"{path}: {error.field} is {error.value!r}, give {error.accepted}") from None


def _list(value: object, path: Path, key: str) -> tuple[str, ...]:
    if value is not None and not isinstance(value, list):
        raise RecordingError(f"{path}: {key} is {value!r}, give a list of topics")
    return tuple(_text(item, path, key) for item in value or ())


def _text(value: object, path: Path, key: str) -> str:
    if value is not None and not (isinstance(value, str) and value.strip()):
        raise RecordingError(f"{path}: {key} is {value!r}, give a name")
    return value.strip() if isinstance(value, str) else ""
