"""Dictionaries, EDMD fit, bilinear models."""
