"""Landmark positions: their computation from a girdle, and the numbers and joint movements that they measure."""
