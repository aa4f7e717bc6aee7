"""The closed form of any small tree, in the plane and in space, by SymPy.

Each joint is stated as a constraint on the child's pose and differentiated twice by SymPy, which
gives velocity and acceleration of every body by those of its parent. D'Alembert's principle makes
M v̇ + V + G = F of them, and Gauss's principle of least constraint the solution: v̇ minimises a
sum of weighted squares, so that every pivot is a sum of positive terms.

Nothing here knows of the recursions: each of the two proves the other.
"""
