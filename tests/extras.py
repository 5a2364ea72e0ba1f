"""Marks for tests of what an extra brings: skipped, with the way out, where it is not installed."""

from importlib.util import find_spec

import pytest

from armwright.sampling import GP_PACKAGES

NEEDS_GP = pytest.mark.skipif(
    any(find_spec(package) is None for package in GP_PACKAGES),
    reason='the sampler gp is not tested without its packages: pip install "armwright[gp]", here `make gp`',
)
