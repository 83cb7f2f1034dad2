"""Stone Soup's JPDA on the same records, to compare with. Needs `pip install stonesoup`.

Stone Soup's own parts, set up as its JPDA tutorial does with multi-measurement initiation, with the
noise, detection probability and clutter density that the tracker here is given; LiDAR and radar
only. https://stonesoup.readthedocs.io
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from importlib.util import find_spec
from typing import Any

import numpy as np

from twinscrew.hil_sim.tracks.autoferry import (
    POSITIONS,
    Frame,
    Record,
    RecordingSettings,
    Reported,
    within_range,
)
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.tracking.kalman import STATES

PSD, FIRST_MPS, DETECTION, CLUTTER, COAST_S, HITS = 0.3, 2.5, 0.9, 5e-6, 4.0, 3


def track_stonesoup(
    records: Sequence[Record], sensors: Sequence[str], settings: RecordingSettings
) -> Iterator[Frame]:
    """Give what Stone Soup's JPDA reports after each record of LiDAR and radar."""
    if find_spec("stonesoup") is None:
        raise ConfigError("needs the package stonesoup: pip install stonesoup", key="--compare")
    from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
    from stonesoup.dataassociator.probability import JPDA
    from stonesoup.deleter.time import UpdateTimeDeleter
    from stonesoup.functions import gm_reduce_single
    from stonesoup.hypothesiser.distance import DistanceHypothesiser
    from stonesoup.hypothesiser.probability import PDAHypothesiser
    from stonesoup.initiator.simple import MultiMeasurementInitiator
    from stonesoup.measures import Mahalanobis
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import (
        CombinedLinearGaussianTransitionModel,
        ConstantVelocity,
    )
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.array import CovarianceMatrix, StateVectors
    from stonesoup.types.detection import Detection
    from stonesoup.types.state import GaussianState
    from stonesoup.types.update import GaussianStateUpdate
    from stonesoup.updater.kalman import KalmanUpdater

    model = CombinedLinearGaussianTransitionModel([ConstantVelocity(PSD), ConstantVelocity(PSD)])
    predictor, updater = KalmanPredictor(model), KalmanUpdater(None)
    joint = JPDA(PDAHypothesiser(predictor, updater, CLUTTER, prob_detect=DETECTION))
    deleter = UpdateTimeDeleter(timedelta(seconds=COAST_S))
    prior = GaussianState(
        [[0.0]] * 4, np.diag([0.0, FIRST_MPS**2, 0.0, FIRST_MPS**2]), timestamp=None
    )
    initiator = MultiMeasurementInitiator(
        prior_state=prior,
        deleter=deleter,
        data_associator=GNNWith2DAssignment(
            DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=4)
        ),
        updater=updater,
        min_points=HITS,
    )
    measured = {
        name: LinearGaussian(4, (0, 2), CovarianceMatrix(np.diag([noise.sigma_m**2 + 1.0] * 2)))
        for name, noise in settings.noise.items()
        if name in POSITIONS
    }
    epoch = datetime(1970, 1, 1, tzinfo=UTC).replace(tzinfo=None)
    tracks: set[Any] = set()
    names: dict[str, int] = {}
    for record in records:
        if record.sensor not in sensors or record.sensor not in POSITIONS:
            continue
        now = epoch + timedelta(seconds=record.time_s)
        found = {
            Detection(place.reshape(2, 1), timestamp=now, measurement_model=measured[record.sensor])
            for place in within_range(record, settings).detections + record.own_N
        }
        used = set()
        for track, hypotheses in joint.associate(tracks, found, now).items():
            states, weights = [], []
            for hypothesis in hypotheses:
                if hypothesis:
                    states.append(updater.update(hypothesis))
                    used.add(hypothesis.measurement)
                else:
                    states.append(hypothesis.prediction)
                weights.append(hypothesis.probability)
            mean, covariance = gm_reduce_single(
                StateVectors([state.state_vector for state in states]),
                np.stack([state.covar for state in states], axis=2),
                np.asarray(weights, float),
            )
            if any(hypothesis for hypothesis in hypotheses):
                track.append(GaussianStateUpdate(mean, covariance, hypotheses, now))
            else:
                track.append(hypotheses[0].prediction)
        tracks -= deleter.delete_tracks(tracks)
        tracks |= initiator.initiate(found - used, now)
        reported = []
        for track in tracks:
            x = np.zeros(STATES)
            x[:4] = np.asarray(track.state_vector, float).ravel()[[0, 2, 1, 3]]
            name = names.setdefault(track.id, len(names))
            reported.append(Reported(name, x, np.zeros((STATES, STATES)), 1.0))
        yield Frame(record.time_s, record.sensor, reported)
