"""The fast path of girdles with effects at work: nearest postures by machine code, Gauss-Newton steps around them."""
