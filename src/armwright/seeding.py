"""Seeds derived from the seed of a run and a purpose, so that resuming needs no generator state."""

import numpy as np

SAMPLING, PROPOSING = 1, 2  # purposes of seeds within a run


def derived_seed(seed: int, *key: int) -> int:
    """Return a 32-bit seed for a key (purpose, trial number) under `seed`; different keys are uncorrelated."""
    return int(np.random.SeedSequence([seed, *key]).generate_state(1)[0])
