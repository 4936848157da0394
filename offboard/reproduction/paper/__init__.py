"""What the paper says, beside what was found here."""
