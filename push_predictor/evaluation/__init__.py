"""How good a model is: metrics, splits, validation against recordings, pictures and reports."""
