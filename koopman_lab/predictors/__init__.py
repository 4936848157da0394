"""Prediction models that a controller can plan with, and the table of those that are learned."""
