"""From positions of bony landmarks in any laboratory frame to the angles of the girdle (thesis, Appendix A)."""
