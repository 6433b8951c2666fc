"""How far an adaptation can be trusted: its uncertainty, its gap on what was held out of it, and if it is a thorax."""
