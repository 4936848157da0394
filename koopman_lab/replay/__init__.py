"""A log once more: sent again as it was, or a node run again on its inputs and compared."""
