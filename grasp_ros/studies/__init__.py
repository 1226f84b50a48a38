"""Studies: measurements that a reader can repeat."""
