"""What a person sees of the lab: a pure reducer of its messages, a server, and one page."""
