"""The science: data, replay, effects, diagnosis. Knows nothing of the web."""
