"""MJCF, the files of MuJoCo.

MuJoCo's own compiler reads a file, in a process of its own (`compiler`), after `files` has checked
which files it would open. The arrays of the compiled model (`compiled`) then become bodies, joints,
effects and constraints of a scene (`robot`).
"""
