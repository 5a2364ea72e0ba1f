"""The physical arm, its actuators, and every file format it is read from or written to."""
