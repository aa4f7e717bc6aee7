"""The public functions: each takes a scene and returns a value. The commands print these values.

A scene is given as a path, a built-in name, TOML text, a mapping of tables, or a `Scene`. Errors in
it are raised as `SceneError`, errors of a run or an argument as `RunError`; their `lines` are the
messages that the command line prints. Numbers are in SI units, angles in radians. The functions
print nothing and write nothing but the store of generated code. Each has its own module, which
also holds the steps that the command of the same name calls.
"""
