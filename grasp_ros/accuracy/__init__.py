"""What accuracy costs in time: solvers measured on a scene and on this machine, and the setting to take.

`measure` says what a solver must look like and measures one setting, `truth` is what it is held against, `compare`
measures all settings of several solvers within a time, and chooses, `figure` draws.
"""
