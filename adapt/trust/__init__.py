"""How far an adaptation can be trusted."""

from adapt.trust.trust import Trust, assess_trust

__all__ = ["Trust", "assess_trust"]
