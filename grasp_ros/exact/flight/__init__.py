"""Motion without contact: closed forms, and the search for the first touch."""
