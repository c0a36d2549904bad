"""Everything that is not physics: addresses, exported functions, object files and where they are kept."""
