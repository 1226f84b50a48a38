"""Hard cases: scenes that break solvers, each with what decides whether its result is right.

`case` says what a case is, `scenes` builds them, and `registry` lists those of all files. `study` runs them as a table
beside other solvers; the tests run the same registry. `properties` and `fuzz` do the same for random scenes.
"""
