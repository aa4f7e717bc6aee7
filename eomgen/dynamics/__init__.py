"""The recursive routes: frame by frame over any scalars, in size linear in the mechanism.

Spatial vectors are pairs of 3-vectors, (angular, linear) for motions and (moment, force) for
forces, both at a frame's origin. Notation and algorithms: R. Featherstone, Rigid Body Dynamics
Algorithms (2008); what is done otherwise is said where it is done.
"""
