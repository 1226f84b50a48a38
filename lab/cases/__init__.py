"""Hard cases: scenes that break solvers, each with what decides whether its result is right.

`case` says what a case is, `families` why each is hard and what decides, `scenes` builds their scenes, and `registry`
lists the cases of all files. `python -m lab hard` runs them beside other solvers; the tests run the same registry.

A new case is one more `Case` that the `cases` of a file yields: a family, a name, a function from a solver to the
error, and the bound. A new family stands in `families.ORDER`, a new file in `registry`.
"""
