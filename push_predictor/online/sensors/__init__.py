"""Live sensor topics: poses composed from tf, and the report about a topic.

Imported by `nodes`; no ROS. The rules of samples are those of `recordings`.
"""
