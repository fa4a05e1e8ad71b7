"""The correction network: what physics does not explain, learned from the clouds, on top of any model.

recorder = recorder_for(open_dataset(folder))            # or with setup=..., the extended model
samples = make_samples(target, recorder)                 # replayed once, streamed from disk ever after
trained = train(samples, Split.of(samples), TrainingSpec(network=NetworkSpec(kind="unet2d")), run)
"""

from palpate.correction.corrected_replay import CorrectedFrame, Corrector, replay_corrected
from palpate.correction.networks.architectures import CorrectionNetwork, NetworkSpec, build
from palpate.correction.networks.chamfer import SurfaceLoss
from palpate.correction.online import Learner, OnlineSpec, learn_online
from palpate.correction.samples.corrected_points import Body
from palpate.correction.samples.record_samples import Recorder, make_samples, recorder_for
from palpate.correction.samples.sample_splits import Split
from palpate.correction.samples.sample_store import Batch, Samples, open_samples
from palpate.correction.train import body_for, sample_errors, train
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
    "sample_errors",
    "learn_online",
    "make_samples",
    "open_samples",
    "recorder_for",
    "replay_corrected",
    "train",
]
