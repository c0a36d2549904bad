"""Sand in MuJoCo models: put under them, and read from them."""
