"""The loop over intervals and segments, with its outputs, checks and controllers."""
