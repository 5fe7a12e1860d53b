"""The ROS side of `predict_server`: services, the action `trace_residual`, diagnostics.

Imported by `nodes.predict_server` only.
"""
