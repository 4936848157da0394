"""The calibration session of the paper's section 5.1."""
