"""The reward, from the same measures that evaluations use (:mod:`trace_dag.agents.evaluation.metrics`)."""

from __future__ import annotations

from dataclasses import dataclass

from trace_dag.agents.evaluation.metrics import Metrics
from trace_dag.common.units import GRAVITY_MPS2

_LEAST_DELTA_V_MPS = 1.0
_WORST = 2.0


@dataclass(frozen=True)
class Reward:
    """Weights of the reward.

    During a run an agent gets shares of ``progress`` for the distance driven, up to the recorded distance; standing
    still gives none. At the end it gets ``avoided`` if no parties touched and it finished within twice the recorded
    time (:mod:`trace_dag.scenario.progress`), else nothing. A contact costs ``contact`` times the ratio of its larger
    delta-v to that of the recorded crash (2 at most). It loses ``off_road`` and ``wrong_way`` for each second of these
    (1 at most of each), and ``comfort`` times its hardest braking in g.
    """

    avoided: float = 1.0
    contact: float = 1.0
    progress: float = 0.5
    off_road: float = 0.2
    wrong_way: float = 0.1
    comfort: float = 0.1

    def in_the_end(self, metrics: Metrics) -> float:
        """Return the reward of an episode beside its progress.

        >>> from dataclasses import replace
        >>> driven = Metrics(False, None, None, None, None, 0.0, 0.0, 8.0, 8.0, None, None, 0.0, 0.0, 0.0, 0, 0.0, 0, 0)
        >>> driven = replace(driven, finished=True)
        >>> Reward().in_the_end(driven)
        1.0
        >>> Reward().in_the_end(replace(driven, collided=True, delta_v_mps=4.0, off_road_s=2.0))
        -0.9
        >>> Reward().in_the_end(replace(driven, finished=False))
        0.0
        """
        if metrics.collided:
            worth = -self.contact * min(
                metrics.delta_v_mps / max(metrics.recorded_delta_v_mps, _LEAST_DELTA_V_MPS), _WORST
            )
        else:
            worth = self.avoided if metrics.finished else 0.0
        worth -= min(self.off_road * metrics.off_road_s, 1.0) + min(self.wrong_way * metrics.wrong_way_s, 1.0)
        return worth - self.comfort * metrics.max_deceleration_mps2 / GRAVITY_MPS2

    def on_the_way(self, driven_m: float, before_m: float, recorded_m: float) -> float:
        """Return the reward of a step from ``before_m`` to ``driven_m``.

        ``recorded_m`` is the whole distance driven in the recorded crash.
        """
        whole = max(recorded_m, 1.0)
        return self.progress * (min(driven_m / whole, 1.0) - min(before_m / whole, 1.0))
