"""Parts of nodes that more than one node has."""
