"""Runs with a proof: boxes that hold the motion, by Taylor series over balls and Lohner's method.

Numbers are balls, a midpoint and a radius, whose operations enclose those of real numbers
(python-flint). Sources: Moore, Interval Analysis, 1966; Lohner, Enclosing the solutions of ordinary
initial and boundary value problems, 1987; Nedialkov, Jackson and Corliss, Validated solutions of
initial value problems for ordinary differential equations, Applied Mathematics and Computation 105,
1999.
"""
