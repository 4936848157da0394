"""Bilinear Koopman models: dictionaries of observables, EDMD fit, and the models themselves."""
