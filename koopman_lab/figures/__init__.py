"""Figures of data, models and runs, one file a figure."""
