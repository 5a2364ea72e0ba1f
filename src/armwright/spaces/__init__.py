"""What may be varied, and how a design becomes an arm."""
