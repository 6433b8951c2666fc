"""What data can tell before a residual is seen: separability, predicted power, the next measurement."""
