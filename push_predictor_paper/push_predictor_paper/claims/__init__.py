"""One folder or module per claim: its computation, figure, table, and whether it is reproduced.

`report` lists the claims; each offers `section(study)`.
"""
