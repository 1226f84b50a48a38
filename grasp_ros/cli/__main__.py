"""`python -m grasp_ros.cli`: the command line without its script."""

import sys

from grasp_ros.cli.main import main

sys.exit(main())
