"""How long a test waits for what a busy machine shows."""

PATIENCE_MS = 60_000
