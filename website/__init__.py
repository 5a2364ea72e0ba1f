"""What of the user guide is made when it is built: references from the code, pages from the README, links to files."""
