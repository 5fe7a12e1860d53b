"""A rig of planar pushing that is simulated independently of the project, and recordings made on it."""
