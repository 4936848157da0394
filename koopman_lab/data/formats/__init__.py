"""Session logs for other programs, and from them: one file a format, and their table."""
