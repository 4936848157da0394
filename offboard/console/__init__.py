"""What a person starts: the ``klab`` command."""
