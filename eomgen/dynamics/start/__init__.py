"""The start of a motion in numbers: assembly, singular positions, positions along the motion."""
