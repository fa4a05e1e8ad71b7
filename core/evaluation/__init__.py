"""Evaluation of the stated model, named causes and correction networks on test sequences.

`palpate.evaluation.run_evaluation.evaluate` compares models on the test sequences of a dataset.
`palpate.evaluation.paper_tables.run_paper` makes the three tables of Wu, Kazanzides and Unberath
(2020). Both are imported separately because they load the solver and torch.
"""
