"""How good a model is: metrics, splits, intervals, validation against recordings.

Import `metrics`, `validation`, `offline`, `splits`, `push_scores` and `estimate`; `alarm` and `report` have folders.
"""
