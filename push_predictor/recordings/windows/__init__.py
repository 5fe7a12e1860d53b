"""Windows cut from the streams: one implementation, used offline and online.

Import `finder` and `push_window`; the other modules are its steps.
"""
