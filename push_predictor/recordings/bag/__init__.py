"""MCAP files and rosbag2 folders as raw messages, also where they are damaged.

Import `reader`, `writer`, `metadata`, `cdr` and `definitions`; the `mcap_*` modules are the layers below `reader`.
"""
