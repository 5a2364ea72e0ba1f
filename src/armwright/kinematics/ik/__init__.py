"""Joint angles that bring the tool to poses."""
