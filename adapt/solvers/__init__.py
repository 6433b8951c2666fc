"""The two fits: postures of a girdle closest to measured ones, and the girdle closest to a subject's postures."""
