"""Regenerate the paper's tables and figures: `python -m paper`, or `make paper`."""
