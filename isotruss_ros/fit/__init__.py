"""Executable `fit_tube_stiffness`: from measured points to the stiffness laws of a robot file."""
