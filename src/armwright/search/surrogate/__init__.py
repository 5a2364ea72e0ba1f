"""Black-box search by Gaussian processes over quantities that the built-in physics gives without an evaluation."""
