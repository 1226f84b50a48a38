"""When a plant advances: what it admits, what it waits for, and with the wall clock."""
