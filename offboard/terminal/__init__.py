"""What a person types and sees at a terminal: options, messages, progress."""
