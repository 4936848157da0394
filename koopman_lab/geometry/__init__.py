"""Angles, planar poses, wheels."""
