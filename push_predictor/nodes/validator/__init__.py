"""ROS parts of `push_validator`: subscribers, prediction client, markers, diagnostics.

Imported by `nodes.push_validator` only.
"""
