"""`python -m trajopt`: the command line where its script is not on the path."""

from trajopt.cli import main

main()
