"""The public functions: a scene in, a value out. The commands print what they return.

Every function takes a scene as a path, a built-in name, TOML text, a mapping of tables, or a
`Scene`. What is wrong with it is raised as `SceneError`, what is wrong with a run as `RunError`;
`lines` of either are the messages that the command line prints. Numbers are in SI units, angles in
radians. Nothing is printed, and nothing is written but to the store of generated code. Each
function has a module of its own; beside it stand the parts that the command of that name calls.
"""
