"""Seas, ships and sensors to try the estimators on; knows nothing of them."""
