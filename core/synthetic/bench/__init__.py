"""Block, tool and sensors of the virtual bench, and the motions that it makes."""
