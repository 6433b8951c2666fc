"""Effects of bones that differ from the cadaver's."""
