"""The desk's side of the radio: logger, sampler, controller, console."""
