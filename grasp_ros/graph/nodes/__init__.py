"""The nodes of the graph, and how they start."""
