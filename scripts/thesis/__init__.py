"""The tables of the thesis as printed, the adaptations beside them, and how far the two are apart."""
