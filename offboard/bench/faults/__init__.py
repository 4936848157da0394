"""Every fault on the whole robot, and what it does."""
