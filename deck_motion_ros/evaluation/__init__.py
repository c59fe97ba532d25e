"""How good it was: metrics, the papers' experiments, the report."""
