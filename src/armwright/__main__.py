"""`python -m armwright`."""

from armwright.cli import main

main()
