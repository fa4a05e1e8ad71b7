"""The correction network: what physics does not explain, learned from the clouds, on top of any model.

recorder = recorder_for(open_dataset(folder))            # or with setup=..., the extended model
samples = make_samples(target, recorder)                 # replayed once, streamed from disk ever after
trained = train(samples, Split.of(samples), TrainingSpec(network=NetworkSpec(kind="unet2d")), run)
"""

from core.correction.body import Body
from core.correction.chamfer import SurfaceLoss
from core.correction.inference import CorrectedFrame, Corrector, replay_corrected
from core.correction.networks import CorrectionNetwork, NetworkSpec, build
from core.correction.online import Learner, OnlineSpec, learn_along
from core.correction.request import TrainingSpec
from core.correction.samples import Batch, Samples, open_samples
from core.correction.sampling import Recorder, make_samples, recorder_for
from core.correction.splitting import Split
from core.correction.trained import Trained
from core.correction.training import body_for, errors_of, train

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
    "Trained",
    "TrainingSpec",
    "body_for",
    "build",
    "errors_of",
    "learn_along",
    "make_samples",
    "open_samples",
    "recorder_for",
    "replay_corrected",
    "train",
]
