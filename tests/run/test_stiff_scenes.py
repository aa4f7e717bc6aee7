"""What the generated Jacobian spares Radau: `campaigns/stiff_scenes.py` prints how much."""

import numpy as np
import pytest
from campaign import some
from campaigns.stiff_scenes import STIFF, run


@pytest.mark.every(2)
@pytest.mark.parametrize("rtol", some([1e-3], [1e-3, 1e-6]))
@pytest.mark.parametrize("scene", some(["stiff_beam", "light_cart_pole"], list(STIFF)))
def test_generated_jacobian_takes_fewer_evaluations(scene: str, rtol: float) -> None:
    """No derivatives for its columns, and it is not worse: the same steps but for a few."""
    own, other = (run(scene, rtol, exact=exact) for exact in (True, False))
    assert own.evaluations < other.evaluations
    columns = len(own.y) * other.jacobians
    assert own.evaluations < 1.02 * (other.evaluations - columns)
    assert own.steps < 1.1 * other.steps
    assert np.isfinite(own.y).all()
