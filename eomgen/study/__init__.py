"""What a scene's numbers are worth: accuracy, verification, cost."""
