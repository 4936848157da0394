"""Receives and stores, nothing else."""
