"""Camera to phantom: from the rest cloud, by table, edges and ICP, or as accepted by hand."""
