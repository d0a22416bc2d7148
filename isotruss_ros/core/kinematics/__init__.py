"""From roller travel to node positions: equations (3), (12) and (13)."""
