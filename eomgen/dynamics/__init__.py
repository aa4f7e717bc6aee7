"""The recursive algorithms of rigid-body dynamics, frame by frame, over any scalars.

Spatial vectors are pairs of 3-vectors: (angular, linear) for motions, (moment, force) for forces,
both at a frame's origin. The joint motion subspace S is explained in `scene.joints.base`. Notation
and algorithms follow R. Featherstone, Rigid Body Dynamics Algorithms (2008); differences are noted
where they are. SI units and radians throughout.
"""
