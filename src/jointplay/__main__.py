"""`python -m jointplay`: the command line."""

import sys

from jointplay.cli import main

sys.exit(main())
