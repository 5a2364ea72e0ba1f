"""Arms that can be bought or are described by a URDF, on a task."""
