"""The granular continuum by the material point method; knows nothing of rftsim."""
