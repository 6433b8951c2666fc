"""Command line, and its output on the terminal."""
