"""`python -m grasp_ros.cli`: the command line without its script."""

import sys

from grasp_ros.cli.main import grasp

status = grasp()
# Where an interrupt meets code in `exec`, that of a dataclass say, Python remembers it even if it is caught, and would
# end `-m` by the signal instead of this status. The next code that it evaluates makes it forget.
exec("")
sys.exit(status)
