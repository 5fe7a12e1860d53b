"""One module a claim: what is computed for it, its figure, its table, and whether it holds here."""
