"""`python -m trajopt`: the command line where its script is not on the path."""

import sys

from trajopt.cli import main

sys.exit(main())
