"""Effects of the measurement: frames, markers and estimates that are off."""
