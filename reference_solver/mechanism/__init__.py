"""What a mechanism is made of, as data and as terms of the equations: bodies, joints, loads, laws."""
