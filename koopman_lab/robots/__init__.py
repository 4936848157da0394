"""What kinds of robots there are."""
