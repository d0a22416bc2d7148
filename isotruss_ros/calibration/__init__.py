"""The stiffness of one's own tube, fitted to measurements."""
