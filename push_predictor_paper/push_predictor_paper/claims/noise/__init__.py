"""Claims about the size and the shape of the noise.

`section.section` is the section of the report; the other modules belong to it.
"""
