"""Gymnasium and dm_control tasks on sand. None yet."""
