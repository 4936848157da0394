"""The library of robot and desk: no program of its own, and no socket outside ``bus``."""
