"""`grasp`, the command line: one file of subcommands per subject."""
