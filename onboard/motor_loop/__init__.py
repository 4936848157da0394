"""Acceleration and velocity control of the wheels."""
