"""ROS parts of `push_validator`: subscribers, prediction client, publishers, ~/finish, diagnostics.

Imported by `nodes.push_validator` only.
"""
