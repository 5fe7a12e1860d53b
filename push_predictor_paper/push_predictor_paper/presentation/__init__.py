"""How the report is shown: the page, the place of each claim in the paper, tables as files.

Nothing here computes a result.
"""
