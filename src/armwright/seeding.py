"""Seeds for everything random, derived from one seed and a place: resuming needs no stored generator."""

import numpy as np


def derived_seed(seed: int, *place: int) -> int:
    """A 32-bit seed for this place (a trial's number, a purpose) under `seed`; places do not correlate."""
    return int(np.random.SeedSequence([seed, *place]).generate_state(1)[0])
