"""The ``trajopt`` command.

Exit codes: 0 done, 1 stopped before convergence (the best motion is still written), 2 bad input
(one line on the error stream), 3 internal error.
"""

from trajopt.cli.app import app, main

__all__ = ["app", "main"]
