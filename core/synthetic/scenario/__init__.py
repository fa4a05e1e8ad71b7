"""Scenarios: what is believed, what is hidden, and what else disturbs the experiment."""
