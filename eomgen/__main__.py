"""`python -m eomgen`."""

import sys

from eomgen.cli import main

sys.exit(main())
