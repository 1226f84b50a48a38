"""The fault drills: accidents done to graphs of real processes, and what comes of them."""
