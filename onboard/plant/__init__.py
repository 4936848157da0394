"""What stands in for hardware: motors, body, encoders, cameras."""
