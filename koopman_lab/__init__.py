"""The library: no process, no clock, no socket outside ``bus``."""
