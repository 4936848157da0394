"""Programs of the robot's side of the radio: the motor loop, and the plant in hardware's place."""
