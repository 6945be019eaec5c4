"""Pages written by the server; they work without scripts, and a small script makes them live."""
