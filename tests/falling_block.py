"""A block that falls on two feet, as a scene."""

from scenes import WEIGHT, effect, lone

BLOCK = lone(
    "free",
    WEIGHT,
    effect("external_force", name="crane", body="block", force=[1, "lift"]),
    effect(
        "contact",
        name="floor",
        law="impact",
        points=["left", "right"],
        restitution=0.3,
        friction=0.5,
        slip_speed=0.01,
    ),
    body="block",
    on="flight",
    name="block",
    points=[
        {"name": "left", "body": "block", "at": [-0.3, 0.0]},
        {"name": "right", "body": "block", "at": [0.3, 0.0]},
    ],
    inputs=[{"name": "lift", "default": 0.0}],
    initial={"q": {"block_y": 0.1, "block_angle": 0.2}},
    simulation={"t_end": 1.0},
)
"""It falls on two feet, which bounce until they stand, and is pushed and lifted."""
