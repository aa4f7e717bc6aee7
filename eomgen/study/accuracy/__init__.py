"""The accuracy of a run and its cost: references, error estimates, the choice of a method."""
