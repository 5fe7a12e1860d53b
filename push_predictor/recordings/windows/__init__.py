# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Push windows cut from the streams: one implementation, used offline and online.

Import `finder`, `push_window` and `stream_faults`; the other modules are the steps of `finder`.
"""
