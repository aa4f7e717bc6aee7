"""The straight-line program: tape, passes, derivatives, printing. It knows no mechanics."""
