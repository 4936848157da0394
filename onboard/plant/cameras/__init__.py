"""What stands in for the motion-capture cameras."""
