"""What can go wrong, one class per thing a caller may want to treat differently.

Every message names the file or field, its value and what is accepted; the command line prints it as one line.
"""

from __future__ import annotations


class PushPredictorError(Exception):
    """Any failure that this package foresees."""


class RigError(PushPredictorError):
    """The push_rig record is missing or wrong."""


class RecordingError(PushPredictorError):
    """A recording cannot be read."""


class TableError(PushPredictorError):
    """A push table cannot be read."""


class ImportSourceError(PushPredictorError):
    """A foreign file cannot be imported; the message names file and line."""


class ModelFileError(PushPredictorError):
    """A model file is damaged, foreign or newer than this version."""


class TrainingError(PushPredictorError):
    """A model cannot be trained from these rows."""


class RequestError(PushPredictorError):
    """A prediction was asked for with a value that is not accepted."""

    def __init__(self, field: str, value: object, accepted: str) -> None:
        super().__init__(f"{field}: {value!r} is not accepted, give {accepted}")
        self.field, self.value, self.accepted = field, value, accepted

    def within(self, place: str) -> RequestError:
        """The same of a field in a larger message: `steps[2].angle` of `angle` within `steps[2]`."""
        return RequestError(f"{place}.{self.field}", self.value, self.accepted)
