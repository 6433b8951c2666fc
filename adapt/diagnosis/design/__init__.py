"""What these data can tell apart, and what to measure next."""
