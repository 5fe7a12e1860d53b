# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Repairs of a stream before windows are found: begin at chain.py."""
