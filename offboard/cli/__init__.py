"""Where the ``klab`` command begins; composes all others."""
