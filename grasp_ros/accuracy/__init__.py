"""What accuracy costs in time: solvers measured on a scene and on this machine, and the setting to take.

`contender` says what a solver must look like, `truth` what it is held against, `measure` measures one setting,
`compare` all settings of several solvers within a time, and chooses, `figure` draws.
"""
