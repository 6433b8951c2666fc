"""How good an adaptation is: gaps on held-out postures, uncertainty, subjects simulated with a known truth."""
