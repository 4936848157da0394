"""Parks the robot by predictive control (paper, sections 4 and 5.4)."""
