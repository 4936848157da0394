"""Reference runs that models are validated with (paper, section 5.3)."""
