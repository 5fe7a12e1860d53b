"""Recorded pushes: streams in and out, the rig they were made on, and the windows cut out of them."""
