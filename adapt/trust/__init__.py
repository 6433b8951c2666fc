"""How far an adaptation can be trusted."""

from adapt.trust.trust import Trust, trust

__all__ = ["Trust", "trust"]
