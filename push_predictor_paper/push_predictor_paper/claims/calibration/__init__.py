"""Claim: predicted intervals and distributions are calibrated (goes beyond the paper).

Import `calibration.section`.
"""
