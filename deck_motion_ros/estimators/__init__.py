"""Estimators: one verb, update(sample) -> estimate; no clock, no message, no file."""
