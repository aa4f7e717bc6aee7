"""Studies of a scene: accuracy, verification, cost."""
