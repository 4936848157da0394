"""`klab bench soak`: a lab in real time for an hour, in which something breaks all the time."""
