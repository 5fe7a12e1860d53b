# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An independent simulator of planar pushing: a slider on discrete support points with Coulomb friction."""
