"""Arms that exist already, read from URDF."""
