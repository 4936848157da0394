"""What every process of the desk shares that commands the robot or speaks for a person."""
