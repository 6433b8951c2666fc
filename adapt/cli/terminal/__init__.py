"""Terminal output: progress, tables and sentences."""
