"""The force laws against what is published, computed elsewhere, or measured; a module for each study."""
