"""How accurately contacts are integrated: their first neglected Taylor term, relative to the impact."""

ACCURACY = 1e-16  # default: costs a fifth more than 1e-11, and some scenes amplify an error by 1e7
FINEST, COARSEST = 1e-16, 1e-3
