"""The state of the lab, from its messages alone."""
