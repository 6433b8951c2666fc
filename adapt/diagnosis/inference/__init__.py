"""Inference from fits to names: causes that predict, their alternatives, and the unexplained share of the gap."""
