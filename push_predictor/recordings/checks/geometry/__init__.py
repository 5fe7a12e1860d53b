# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Contacts against the outline: begin at stage.py."""
