"""The public face of the library, which ``import koopman_lab`` gives out."""
