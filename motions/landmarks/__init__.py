"""Angles of the girdle from positions of bony landmarks in any laboratory frame (thesis, Appendix A)."""
