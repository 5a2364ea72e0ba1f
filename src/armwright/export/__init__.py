"""Arms in the formats of other tools."""
