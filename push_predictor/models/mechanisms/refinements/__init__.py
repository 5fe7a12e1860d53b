"""Mechanisms that refine an analytical model; see forward_parameters."""

from push_predictor.models.mechanisms.refinements.forward_parameters import REFINEMENTS

__all__ = ["REFINEMENTS"]
