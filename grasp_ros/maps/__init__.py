"""Maps and samples of a scene's outcomes: which rows, where they are kept, and who computes them."""
