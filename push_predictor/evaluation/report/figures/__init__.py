"""Pictures of a validation; each module draws one, `canvas` holds what they share."""
