"""Scenes that come with rftsim, and running them or somebody's model."""
