"""Recordings, pictures and plots of runs."""
