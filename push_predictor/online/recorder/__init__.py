"""Record the streams of a rig into a bag while they arrive, and report what has been recorded."""
