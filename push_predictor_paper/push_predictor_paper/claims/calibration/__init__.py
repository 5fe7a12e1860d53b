"""Beyond the paper: are the predicted intervals and distributions calibrated?

`section.section` is the section of the report; the other modules belong to it.
"""
