# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The outline against the contacts: what corrects it, and which mistake explains the rest."""
