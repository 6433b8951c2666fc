"""Effects of bones that are not the cadaver's."""
