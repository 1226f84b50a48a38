"""Methods to integrate the grasp beside `exact`: the same physics and the same record, another price.

`registry` is the table of all of them and the one door. They know the physics and nothing above it.
"""
