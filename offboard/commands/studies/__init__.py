"""Commands that simulate closed loops many times."""
