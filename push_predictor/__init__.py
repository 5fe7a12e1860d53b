"""Models of planar pushing: learnt from recordings, served over ROS 2, checked against outcomes."""

__version__ = "0.1.0"
