"""Effects of the measurement: errors of frames, markers and estimates."""
