"""From data to law: 3D-RFT's table from plates, and a sand's parameters from plate and drag tests."""
