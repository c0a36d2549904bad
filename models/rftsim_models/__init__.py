"""Models: MJCF built for scenes on sand; they know nothing of it."""
