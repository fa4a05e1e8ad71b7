"""Evaluation: what a network, a named cause and both are worth on sequences that nothing was fitted
on.

`palpate.evaluation.run_evaluation.evaluate` is the ladder of a dataset,
`palpate.evaluation.paper_tables.run_paper` the three tables of Wu, Kazanzides and Unberath (2020);
both are heavy to import.
"""
