"""The path of an arm through its cycle, and what its drives bear on it."""
