"""Environments of Gymnasium over a scene: one, or many that step together as columns."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.random import Generator

from eomgen.run.module import GeneratedModule
from eomgen.run.problem import FloatArray


@dataclass(frozen=True, eq=False)
class Task:
    """What an environment does; functions take columns: states (ny, k), inputs (nu, k).

    module     generated code of the scene
    initial    its initial state, (ny,)
    advanced   (y, u, t) -> (ny, k), the states a step after t (k,)
    projected  (y) -> (ny, k), states with unit quaternions, on the constraints
    inputs     the inputs that are actions, with their bounds; others keep their defaults
    observed   (t, y, u) -> (no, k)
    reward     (t, y, u) -> (k,), after a step
    failed     (t, y, u) -> (k,), whether an episode ends there
    start      by the index of a state what draws its first values, from shares between 0 and 1
    dt         length of a step, s
    length     steps after which an episode is cut off
    """

    module: GeneratedModule
    initial: FloatArray
    advanced: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
    projected: Callable[[FloatArray], FloatArray]
    inputs: Mapping[str, tuple[float, float]]
    observed: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
    reward: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
    failed: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
    start: Mapping[int, Callable[[FloatArray], FloatArray]]
    dt: float
    length: int

    def action_space(self) -> Any:
        """The bounds of the inputs."""
        low, high = np.array([*self.inputs.values()], dtype=np.float64).reshape(-1, 2).T
        return gymnasium.spaces.Box(low, high, dtype=np.float64)

    def observation_space(self) -> Any:
        """Any numbers."""
        y = self.initial[:, None]
        count = len(self.observed(np.zeros(1), y, self.applied(np.zeros((1, len(self.inputs))))))
        return gymnasium.spaces.Box(-np.inf, np.inf, (count,), dtype=np.float64)

    def applied(self, actions: FloatArray) -> FloatArray:
        """All inputs (nu, k) under actions (k, na), which are kept within their bounds."""
        names = list(self.module.INPUTS)
        u = np.repeat(np.array([*self.module.INPUTS.values()])[:, None], len(actions), axis=1)
        for i, (name, (low, high)) in enumerate(self.inputs.items()):
            u[names.index(name)] = np.clip(actions[:, i], low, high)
        return u

    def begun(self, count: int, random: Generator) -> FloatArray:
        """First states (ny, count), drawn."""
        y = np.repeat(self.initial[:, None], count, axis=1)
        for i, drawn in self.start.items():
            y[i] = drawn(random.random(count))
        return self.projected(y) if self.start else y


class Lanes:
    """The states of k episodes that step together."""

    def __init__(self, task: Task, count: int) -> None:
        self.task, self.count = task, count
        self.y = np.zeros((len(task.module.STATES), count))
        self.steps = np.zeros(count, dtype=np.int64)
        self.u = task.applied(np.zeros((count, len(task.inputs))))

    @property
    def t(self) -> FloatArray:
        """The time of each episode, (k,), s."""
        return np.asarray(self.steps * self.task.dt)

    def begin(self, which: np.ndarray[Any, np.dtype[np.bool_]], random: Generator) -> None:
        """Begin the episodes of a mask (k,) anew."""
        self.y[:, which] = self.task.begun(int(which.sum()), random)
        self.steps[which] = 0

    def observed(self) -> FloatArray:
        """Observations, (k, no)."""
        return self.task.observed(self.t, self.y, self.u).T.copy()

    def step(self, actions: FloatArray) -> tuple[FloatArray, Any, Any, Any]:
        """Rewards, whether each episode failed, was cut off, and diverged, (k,) each. One that
        diverges fails, and keeps its last finite state.
        """
        self.u = self.task.applied(actions)
        y = self.task.advanced(self.y, self.u, self.t)
        diverged = ~np.isfinite(y).all(axis=0)
        self.y = np.where(diverged, self.y, y)
        self.steps += 1
        given = (self.t, self.y, self.u)
        failed = diverged | (self.task.failed(*given) != 0)
        cut = ~failed & (self.steps >= self.task.length)
        return self.task.reward(*given), failed, cut, diverged


class SceneEnv(gymnasium.Env[FloatArray, FloatArray]):
    """One environment."""

    metadata = {"render_modes": []}  # noqa: RUF012  (as Gymnasium declares it)

    def __init__(self, task: Task) -> None:
        self.lanes = Lanes(task, 1)
        self.action_space = task.action_space()
        self.observation_space = task.observation_space()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Draw a first state."""
        super().reset(seed=seed)
        self.lanes.begin(np.ones(1, dtype=bool), self.np_random)
        return self.lanes.observed()[0], {}

    def step(self, action: FloatArray) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Advance by `dt`."""
        reward, failed, cut, diverged = self.lanes.step(np.asarray(action, dtype=float)[None])
        info = {"t": float(self.lanes.t[0]), "diverged": bool(diverged[0])}
        return self.lanes.observed()[0], float(reward[0]), bool(failed[0]), bool(cut[0]), info


class SceneVectorEnv(VectorEnv[FloatArray, FloatArray, Any]):
    """Many that step together; one that ended begins anew with its next step."""

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(self, task: Task, count: int) -> None:
        self.lanes = Lanes(task, count)
        self.num_envs = count
        self.single_action_space = task.action_space()
        self.single_observation_space = task.observation_space()
        self.action_space = batch_space(self.single_action_space, count)
        self.observation_space = batch_space(self.single_observation_space, count)
        self._ended = np.zeros(count, dtype=bool)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Draw the first states of all."""
        super().reset(seed=seed)
        self.lanes.begin(np.ones(self.num_envs, dtype=bool), self.np_random)
        self._ended[:] = False
        return self.lanes.observed(), {}

    def step(self, actions: FloatArray) -> tuple[FloatArray, Any, Any, Any, dict[str, Any]]:
        """Advance those that have not ended; begin the others, with reward 0."""
        again = self._ended.copy()
        reward, failed, cut, diverged = self.lanes.step(np.asarray(actions, dtype=float))
        self.lanes.begin(again, self.np_random)
        reward, failed, cut = np.where(again, 0.0, reward), failed & ~again, cut & ~again
        self._ended = failed | cut
        info = {"t": self.lanes.t, "diverged": diverged & ~again}
        return self.lanes.observed(), reward, failed, cut, info
