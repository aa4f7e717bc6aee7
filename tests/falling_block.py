"""A block that falls on two feet, as a scene."""

BLOCK = """
name = "block"
dimensions = 2
bodies = [{ name = "block", mass = 1.0, inertia_com = 0.1 }]
points = [
    { name = "left", body = "block", at = [-0.3, 0.0] },
    { name = "right", body = "block", at = [0.3, 0.0] },
]
inputs = [{ name = "lift", default = 0.0 }]
joints = [{ name = "flight", type = "free", child = "block" }]
[[effects]]
type = "gravity"
g = 9.81
[[effects]]
type = "external_force"
name = "crane"
body = "block"
force = [1, "lift"]
[[effects]]
type = "contact"
name = "floor"
law = "impact"
points = ["left", "right"]
restitution = 0.3
friction = 0.5
slip_speed = 0.01
[initial]
q = { block_y = 0.1, block_angle = 0.2 }
[simulation]
t_end = 1.0
"""
"""It falls on two feet, which bounce until they stand, and is pushed and lifted."""
