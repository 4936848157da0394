"""The robot's side of the radio: motor loop, and the plant that stands in for hardware."""
