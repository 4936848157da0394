"""Kinds of robots: one description each, and the table of all of them."""
