"""What a planner builds on single predictions: poses in the world, sequences of pushes, the choice among them."""
