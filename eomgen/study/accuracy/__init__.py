"""How exact a run is and what that costs: references, estimates, the choice of a method."""
