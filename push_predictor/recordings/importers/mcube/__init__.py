"""Importer of the MCube lab's preliminary pushes (August 2015).

Import `pushes`; `rig` describes the two blocks and their frames.
"""
