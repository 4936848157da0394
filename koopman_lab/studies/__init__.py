"""Closed-loop studies, one file a study."""
