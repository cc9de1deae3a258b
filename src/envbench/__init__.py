"""Accuracy against time for rendering under environment maps."""
