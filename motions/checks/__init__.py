"""What measured landmarks and angles cannot be: never seen, no person's size, outliers, swapped labels, other signs."""
