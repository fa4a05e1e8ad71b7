"""The dataset that an import writes: setup, sequences, clouds, and what an earlier one left."""
