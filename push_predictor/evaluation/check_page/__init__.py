"""The page of `push_predictor check`: answer, tracks, contacts on the outline, findings, coverage. Import `page`."""
