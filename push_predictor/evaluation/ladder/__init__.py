"""The ladder of fitted mechanics for readers: held-out scores of its steps, as text, JSON and a page."""
