# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Fields of messages of any type: poses, wrenches and scalars, as messages of the types that a recording has.

Import `sources`, `transforms`, `wrench_axes` and `wrench_bias`; `message_text` parses definitions and `columns` reads
fields from CDR.
"""
