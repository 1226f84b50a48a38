"""What is seen of a run while it runs: extremes, losses, settling, the rise of V_c; and ensembles that are observed."""
