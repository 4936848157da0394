"""What a controller can plan with, one file each."""
