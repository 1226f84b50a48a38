"""A user's proof: reference, oracles, hard cases and properties of random scenes.

`reference` integrates the same model with as many digits as wanted, `oracles` knows exact relations, `cases` holds
the hard cases and what decides each, `properties` and `fuzz` hold random scenes against everything that must be true.
"""
