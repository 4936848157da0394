"""How well data and models predict: one step and many, held-out runs, data needed."""
