"""One experiment: a registered dataset with its model, to replay, observe and extend.

experiment = register("my-block")
replay = experiment.replay("poke-top-01")
"""

from palpate.experiment.experiment import Experiment, register, sequences_with_clouds
from palpate.experiment.observed_clouds import ObservedClouds
from palpate.experiment.replayed_sequence import ReplayedSequence

__all__ = ["Experiment", "ObservedClouds", "ReplayedSequence", "register", "sequences_with_clouds"]
