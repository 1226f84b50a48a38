"""How kernels are compiled, and where their machine code is kept."""

import os
import re

from grasp_ros.physics.errors import Refused

_THREADS = os.environ.get("NUMBA_NUM_THREADS", "1")
if re.fullmatch(r"0+|-\d+", _THREADS):  # which numba meets with a traceback
    raise Refused(f"NUMBA_NUM_THREADS: {_THREADS} is not allowed; allowed: a whole number >= 1")
