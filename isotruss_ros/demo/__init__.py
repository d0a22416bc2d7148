"""The demonstration: the real nodes as processes, Fig. 9 of the paper as twists, a picture."""
