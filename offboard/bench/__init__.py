"""Measures this machine and the lab."""
