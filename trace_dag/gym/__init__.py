"""Crashes as environments for learning, for Gymnasium and PettingZoo, on the loop that evaluates agents. Extra ``gym``.

Belongs here: observations and actions as arrays, the reward, an episode step by step, and the environments. Does not
belong here: simulating and measuring, which :mod:`trace_dag.simulation` and :mod:`trace_dag.agents.evaluation` do;
learning.

Importing this package registers ``trace_dag/Crash-v0`` with Gymnasium.
"""

from trace_dag.common.errors import UserError

try:
    import gymnasium
    import pettingzoo  # noqa: F401 - asked here, so that what is missing is said once
except ImportError as error:
    raise UserError(f"environments need {error.name}: pip install 'trace-dag[gym]'") from error

ENVIRONMENT = "trace_dag/Crash-v0"

if ENVIRONMENT not in gymnasium.registry:
    gymnasium.register(ENVIRONMENT, entry_point="trace_dag.gym.single:CrashEnv")
