"""Commands on recorded data and trained models."""
