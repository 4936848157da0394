"""What a stand-in for a robot adds to a port: radio, board clock, faults on demand."""
