"""The configuration of a lab: schema, defaults, loading."""
