"""Skip marks for tests that need an extra."""

import pytest

from armwright.extras import missing_packages

NEEDS_GP = (
    pytest.mark.slow,
    pytest.mark.skipif(
        bool(missing_packages("gp")),
        reason='the sampler gp is not tested without its packages: pip install "armwright[gp]", here `make gp`',
    ),
)
