"""What accuracy costs in time: solvers measured on a scene and on this machine, and the setting to take.

`measure` says what a solver must look like and what it is held against, and measures one setting, `compare` measures
all settings of several solvers within a time, and chooses, `figure` draws.
"""
