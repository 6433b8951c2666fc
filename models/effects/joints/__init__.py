"""Effects of joints and ligaments that give way."""
