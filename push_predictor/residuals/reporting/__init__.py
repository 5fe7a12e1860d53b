# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a person reads of a trace: page, tables, sentences; the JSON is in `outcome`."""
