"""Parameters and initial states from measured motions."""
