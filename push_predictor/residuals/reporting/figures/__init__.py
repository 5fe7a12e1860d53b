"""Pictures of a trace's report."""
