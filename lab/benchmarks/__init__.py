"""Times beside those of other checkouts and of earlier runs."""
