"""Training, playing and judging policies; needs the extra `train`."""
