"""Motion files as CSV: rows, cells, columns and checks, in and out."""
