"""What every node has: parameters, an executor, and messages."""
