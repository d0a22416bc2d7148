"""Regenerate the paper's tables and figures: `python -m isotruss_ros.paper`, or `make paper`."""
