"""A crank-rocker as a scene."""

A, B, C, D = 0.3, 0.8, 0.6, 0.7
"""Lengths of a crank-rocker: crank, coupler, rocker and ground, m."""


def lengths(*values: float) -> dict[str, float]:
    """The parameters of bars of these lengths, so that many of them run by one generated module."""
    return dict(zip("abcd", values, strict=True))


def four_bar(
    lengths: tuple[float, float, float, float] = (A, B, C, D),
    initial: str = "q = { theta = 0.3 }",
    effects: str = "",
    route: str = "auto",
    loops: str = "projected",
) -> str:
    """A four-bar of uniform rods under gravity."""
    bars = [("crank", 1.0, "a"), ("coupler", 2.0, "b"), ("rocker", 1.5, "c")]
    named = zip("abcd", lengths, strict=True)
    text = f'name = "four_bar"\nroute = "{route}"\nloops = "{loops}"\n[parameters]\n'
    text += "".join(f'{name} = {{ value = {x}, unit = "m" }}\n' for name, x in named)
    for name, mass, length in bars:
        text += f'[[bodies]]\nname = "{name}"\nmass = {mass}\n'
        text += f'inertia_com = "{mass}*{length}**2/12"\n'
    pins = [
        ("A", "world", "crank", "[0, 0]", '["-a/2", 0]', 'coordinate = "theta"'),
        ("B", "crank", "coupler", '["a/2", 0]', '["-b/2", 0]', 'coordinate = "phi"'),
        ("D", "world", "rocker", '["d", 0]', '["-c/2", 0]', 'coordinate = "psi"'),
        ("C", "coupler", "rocker", '["b/2", 0]', '["c/2", 0]', "loop = true"),
    ]
    for name, parent, child, at_parent, at_child, more in pins:
        text += f'[[joints]]\nname = "{name}"\ntype = "revolute"\nparent = "{parent}"\n'
        text += f'child = "{child}"\nr_parent = {at_parent}\nr_child = {at_child}\n{more}\n'
    text += '[[effects]]\ntype = "gravity"\ng = 9.81\n'
    return text + f"{effects}[initial]\n{initial}\n"


STOPPED = four_bar(
    effects="""
[[effects]]
type = "contact"
name = "wall"
law = "impact"
body = "coupler"
normal = [-1, 0]
offset = -0.58
restitution = 0.3
friction = 0.2
slip_speed = 0.01
"""
)
"""It falls, and its coupler strikes a wall until it rests there."""
