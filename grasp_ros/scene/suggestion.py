"""What a word that nobody knows may have been meant as."""

from __future__ import annotations

from collections.abc import Collection
from difflib import SequenceMatcher, get_close_matches
from itertools import islice

SHOWN = 12  # of many words that are allowed
ALIKE, TIE, MOST_MEANT = 0.65, 1e-9, 4  # of difflib; words that are as much alike are all named


def allowed(word: str, known: Collection[str], other: str = "") -> str:
    """The end of a refusal: the known word that is meant, or the first that are allowed, behind `other` words."""
    close = get_close_matches(word, known, MOST_MEANT, ALIKE)
    alike = {name: SequenceMatcher(None, name, word).ratio() for name in close}
    best = [name for name in close if alike[name] >= alike[close[0]] - TIE]
    if best:
        return f"did you mean {' or '.join(sorted(best))}?"
    rest = f", ... {len(known)} in all" if len(known) > SHOWN else ""
    return f"allowed: {other}{', '.join(islice(known, SHOWN))}{rest}"
