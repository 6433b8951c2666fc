"""How far an adaptation can be trusted: its uncertainty, its gap on what it has not seen, and if it is a thorax."""
