# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Recorded pushes: streams, rigs and push tables, read and written.

Import `read`, `write`, `load`, `streams`, `rig`, `new_rig` and `table`. The folders are `bag` (files), `fields`
(messages of any type), `decoder` (samples), `windows` (push windows), `checks` (mistakes) and `importers` (other
formats).
"""
