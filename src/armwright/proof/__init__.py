"""What is done to a front before a design of it is recommended."""
