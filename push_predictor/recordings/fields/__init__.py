"""Fields of messages of any type: poses, wrenches and scalars, as messages of the types that a recording has.

Import `sources`, `transforms`, `wrench_axes` and `wrench_bias`; `message_text` parses definitions and `columns` reads
fields from CDR.
"""
