"""Seeds for everything random, derived from a run's seed and a purpose, so that resuming needs no generator state."""

import numpy as np

SAMPLING, PROPOSING, REFINING = 1, 2, 3  # purposes of seeds within a run


def derived_seed(seed: int, *place: int) -> int:
    """Return a 32-bit seed for a place (a purpose, a trial number) under `seed`; places are uncorrelated."""
    return int(np.random.SeedSequence([seed, *place]).generate_state(1)[0])
