"""The desk's side of the radio: logger, sampler, controller, and what a person starts."""
