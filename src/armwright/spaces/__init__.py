"""Design spaces: the parameters of a design, and the arm that it builds."""
