"""Camera to phantom for a body of any shape: search, refinement and uncertainty."""
