"""From a session log to a data set."""
