"""Distances, barriers and failed rollers: what keeps a motion safe."""
