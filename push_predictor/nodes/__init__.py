"""The ROS 2 nodes: wiring alone, the work is in the library."""
