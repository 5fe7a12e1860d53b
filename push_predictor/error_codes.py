# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The error codes of responses: one number for each kind of failure that a client may handle differently."""

from __future__ import annotations

from enum import IntEnum

from push_predictor.errors import (
    BusyError,
    ContactError,
    CovariateError,
    FrameError,
    ImportSourceError,
    InactiveError,
    ModelFileError,
    NothingLeftError,
    NotPausedError,
    PredictionError,
    PushPredictorError,
    RecordingError,
    RigError,
    TableError,
    TooLargeError,
    UnknownModelError,
)


class ErrorCode(IntEnum):
    """The constants of the same names in the services and actions; a response declares those that it can contain."""

    NONE = 0
    INTERNAL_ERROR = 1
    INVALID_REQUEST = 2
    NOT_ACTIVE = 3
    UNKNOWN_MODEL = 4
    INVALID_COVARIATES = 5
    NO_PREDICTION = 6
    INVALID_FRAME = 7
    NO_CONTACT = 8
    TOO_LARGE = 9
    INVALID_FILE = 10
    BUSY = 11
    CANCELLED = 12
    NOT_PAUSED = 13
    NOTHING_LEFT = 14


_CODES: tuple[tuple[type[Exception], ErrorCode], ...] = (
    (UnknownModelError, ErrorCode.UNKNOWN_MODEL),
    (CovariateError, ErrorCode.INVALID_COVARIATES),
    (FrameError, ErrorCode.INVALID_FRAME),
    (ContactError, ErrorCode.NO_CONTACT),
    (TooLargeError, ErrorCode.TOO_LARGE),
    (PredictionError, ErrorCode.NO_PREDICTION),
    (InactiveError, ErrorCode.NOT_ACTIVE),
    (BusyError, ErrorCode.BUSY),
    (NotPausedError, ErrorCode.NOT_PAUSED),
    (NothingLeftError, ErrorCode.NOTHING_LEFT),
    (ModelFileError, ErrorCode.INVALID_FILE),
    (RecordingError, ErrorCode.INVALID_FILE),
    (TableError, ErrorCode.INVALID_FILE),
    (RigError, ErrorCode.INVALID_FILE),
    (ImportSourceError, ErrorCode.INVALID_FILE),
    (OSError, ErrorCode.INVALID_FILE),
    (PushPredictorError, ErrorCode.INVALID_REQUEST),  # the rest: last, because it is the base of the others
)


def error_code(error: BaseException) -> ErrorCode:
    """The code of an exception; INTERNAL_ERROR for one that this package does not foresee."""
    return next((code for kind, code in _CODES if isinstance(error, kind)), ErrorCode.INTERNAL_ERROR)
