# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The package's exceptions, one class for each kind of failure that a caller may handle differently.

Every message names the file or field, its value and what is accepted; the command line prints it as one line.
"""

from __future__ import annotations


class PushPredictorError(Exception):
    """Any failure that this package foresees."""


class NotCompiledError(PushPredictorError, ImportError):
    """A compiled module is there as Python code alone; the message has the command that builds it."""


class DataWarning(UserWarning):
    """Data contain a probable mistake, cover little of the domain, or do not fit the model."""


class RigError(PushPredictorError):
    """The push_rig record is missing or invalid."""


class RecordingError(PushPredictorError):
    """A recording cannot be read."""


class TableError(PushPredictorError):
    """A push table cannot be read."""


class ImportSourceError(PushPredictorError):
    """A file of another format cannot be imported; the message names file and line."""


class ModelFileError(PushPredictorError):
    """A model file is damaged, of another format or newer than this version."""


class TrainingError(PushPredictorError):
    """A model cannot be trained from these rows."""


class RequestError(PushPredictorError):
    """A request contains a value that is not accepted."""

    def __init__(self, field: str, value: object, accepted: str) -> None:
        super().__init__(f"{field}: {value!r} is not accepted, give {accepted}")
        self.field, self.value, self.accepted = field, value, accepted

    def within(self, place: str) -> RequestError:
        """The same error for a nested field: `angle` within `steps[2]` becomes `steps[2].angle`."""
        return type(self)(f"{place}.{self.field}", self.value, self.accepted)


class UnknownModelError(RequestError):
    """A request names a model that is not loaded."""


class CovariateError(RequestError):
    """A covariate of a request is missing, repeated, not finite, or contradicts the poses."""


class FrameError(RequestError):
    """The frame of a request is empty or unknown."""


class ContactError(RequestError):
    """The pusher of a request does not push the slider."""


class TooLargeError(RequestError):
    """A request needs more work than is accepted at once."""


class PredictionError(PushPredictorError):
    """A model has no finite prediction for a push that passed the checks."""


class InactiveError(PushPredictorError):
    """A node received a request that it answers only while it is active."""


class BusyError(PushPredictorError):
    """The same work is under way for another request."""


class NotPausedError(PushPredictorError):
    """A request that needs a paused replay arrived while it plays."""


class NothingLeftError(PushPredictorError):
    """A recording has no further message."""
