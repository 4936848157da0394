"""Channels, nodes, and the two runners."""
