"""What a person sees of the lab: a server, and one page."""
