"""`python -m bristle`."""

from bristle.cli import main

main()
