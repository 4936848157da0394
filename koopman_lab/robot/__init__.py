"""Nominal models of the robot."""
