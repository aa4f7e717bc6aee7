"""The closed form of any small tree, in the plane and in space, by SymPy.

Each joint is a constraint on the child's pose. SymPy differentiates it twice, which gives velocity
and acceleration of every body from its parent's. D'Alembert's principle, projected onto the partial
velocities (Kane's method), gives M v̇ + V + G = F. Gauss's principle of least constraint gives the
solution: v̇ minimises a sum of weighted squares, so that every pivot is a sum of positive terms.

This derivation is independent of the recursions in `dynamics`; tests compare the two.
"""
