"""The coupling to MuJoCo: struct layout, raw memory, and the engine plugin."""
