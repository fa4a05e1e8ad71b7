"""Correction networks: they learn the error that a model leaves, from the clouds.

recorder = recorder_for(open_dataset(folder))  # the stated model; setup=... takes another one
samples = make_samples(target, recorder)  # the model is replayed once; samples are read from disk
trained = train(samples, Split.of(samples), TrainingSpec(network=NetworkSpec(kind="unet2d")), run)
"""

from palpate.correction.corrected_replay import CorrectedFrame, Corrector, replay_corrected
from palpate.correction.networks.architectures import CorrectionNetwork, NetworkSpec, build
from palpate.correction.networks.chamfer import SurfaceLoss
from palpate.correction.online import Learner, OnlineSpec, learn_online
from palpate.correction.sample_errors import sample_errors
from palpate.correction.samples.corrected_points import Body
from palpate.correction.samples.record_samples import make_samples
from palpate.correction.samples.sample_recorder import Recorder, recorder_for
from palpate.correction.samples.sample_splits import Split
from palpate.correction.samples.sample_store import Batch, Samples, body_for, open_samples
from palpate.correction.train import train
from palpate.correction.trained_network import TrainedNetwork
from palpate.correction.training_spec import TrainingSpec

__all__ = [
    "Batch",
    "Body",
    "CorrectedFrame",
    "CorrectionNetwork",
    "Corrector",
    "Learner",
    "NetworkSpec",
    "OnlineSpec",
    "Recorder",
    "Samples",
    "Split",
    "SurfaceLoss",
    "TrainedNetwork",
    "TrainingSpec",
    "body_for",
    "build",
    "learn_online",
    "make_samples",
    "open_samples",
    "recorder_for",
    "replay_corrected",
    "sample_errors",
    "train",
]
