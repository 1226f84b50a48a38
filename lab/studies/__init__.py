"""Measurements that a reader can repeat, and the pages that they write."""
