"""Bauza and Rodriguez (ICRA 2017) reproduced: every claim on simulated and on measured pushes.

Import `report`, `plan` and `work`, as the command `push_predictor report paper` does.
"""
