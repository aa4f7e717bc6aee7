"""A tree of frames and the recursions over it: kinematics, Newton-Euler, M, articulated bodies."""
