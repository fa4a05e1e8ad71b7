"""First look at a recording or a dataset before any job: streams, tool, forces, cuts and clouds."""
