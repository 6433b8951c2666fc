"""From fits to names: which causes predict, which replace one another, what is unexplained."""
