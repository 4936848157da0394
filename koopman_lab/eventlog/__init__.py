"""The standard LCM event log: read, index, write, salvage."""
