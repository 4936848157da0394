"""The onboard program: from velocity and acceleration commands to the motors' duties."""
