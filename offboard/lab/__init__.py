"""Sessions, and the processes that they start and watch."""
