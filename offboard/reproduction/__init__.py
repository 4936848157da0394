"""Every number and figure of the paper, from nothing."""
