"""Quality of an adaptation: gaps on held-out postures, uncertainty, subjects simulated with a known truth."""
