"""A rig in software: a dynamic pusher-slider on distributed support points, and the recordings it leaves."""
