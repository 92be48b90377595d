"""Partially observable Markov decision processes: read a model, solve it, track a belief, act."""

from os import PathLike
from typing import Optional, Sequence, Union, final

__all__ = [
    "Model",
    "ParseError",
    "Policy",
    "PomdpError",
    "Tracker",
    "bound",
    "compact",
    "heuristic",
    "simulate",
    "solve",
    "value",
]

_Key = Union[int, str]
_Path = Union[str, "PathLike[str]"]
_Row = Sequence[float]

class PomdpError(ValueError):
    """What is wrong with a model, a policy or an argument."""

class ParseError(PomdpError):
    """What is wrong with the text of a model, and where, from 1."""

    line: int
    column: int

@final
class Model:
    """A decision model that does not change."""

    @staticmethod
    def parse(text: str) -> Model:
        """The model in a text, .pomdp or .pomdpx."""
    @staticmethod
    def load(path: _Path) -> Model:
        """The model in a file."""
    @staticmethod
    def from_arrays(
        transitions: Sequence[Sequence[_Row]],
        observations: Optional[Sequence[Sequence[_Row]]],
        rewards: Sequence[_Row],
        *,
        discount: float,
        start: Optional[_Row] = None,
        state_names: Optional[Sequence[str]] = None,
        action_names: Optional[Sequence[str]] = None,
        observation_names: Optional[Sequence[str]] = None,
    ) -> Model:
        """T[a][s][t], Z[a][t][z], R[a][s] and the start belief as nested sequences."""
    @property
    def states(self) -> list[str]:
        """Names of the states."""
    @property
    def actions(self) -> list[str]:
        """Names of the actions."""
    @property
    def observations(self) -> list[str]:
        """Names of the observations."""
    @property
    def discount(self) -> float:
        """Discount per step, 0 to 1."""
    @property
    def start(self) -> list[float]:
        """The start belief, one probability a state."""
    @property
    def is_cost(self) -> bool:
        """True if the text states costs; values here are their negatives."""
    @property
    def warnings(self) -> list[str]:
        """What the author of the text may want to mend."""
    def successors(self, state: _Key, action: _Key) -> list[tuple[int, float]]:
        """T(s,a,.): index and probability of each state that may follow."""
    def likelihood(self, action: _Key, observation: _Key) -> list[float]:
        """Z(a,.,z): the observation's probability in each state that is reached."""
    def reward(self, state: _Key, action: _Key) -> float:
        """R(s,a), expected; costs count negative."""
    def to_text(self) -> str:
        """The model as a .pomdp text."""
    def __eq__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...

@final
class Tracker:
    """The exact belief over the states of a model."""

    def __new__(cls, model: Model) -> Tracker: ...
    belief: list[float]
    """One probability a state. Can be set."""
    @property
    def entropy(self) -> float:
        """0 certain, 1 uniform."""
    @property
    def model(self) -> Model:
        """The model."""
    def update(self, action: _Key, observation: _Key) -> float:
        """Takes an action and an observation; p(z|a,b), 0 if it was impossible."""
    def predict(self, action: _Key) -> None:
        """Takes an action of which nothing was observed."""
    def weigh(self, likelihoods: _Row) -> float:
        """Takes a likelihood for each state; the expected one, 0 if nothing is left."""
    def reset(self) -> None:
        """Back to the start belief."""
    def probability(self, state: _Key) -> float:
        """The probability of a state."""

@final
class Policy:
    """From a belief to an action."""

    @staticmethod
    def load(path: _Path, model: Model) -> Policy:
        """Reads a policy of the model: Vigil's, APPL's or pomdp-solve's."""
    def save(self, path: _Path) -> None:
        """Writes a solved policy; the ending decides the format."""
    def action(self, belief: Union[Tracker, _Row]) -> str:
        """Name of the action for a belief."""
    def values(self, belief: Union[Tracker, _Row]) -> list[float]:
        """What the action was chosen by, one number an action."""
    def reset(self) -> None:
        """A new mission begins."""
    @property
    def name(self) -> str:
        """How it was found."""
    @property
    def lower(self) -> Optional[float]:
        """It earns at least this from the start belief on."""
    @property
    def upper(self) -> Optional[float]:
        """No policy earns more than this from the start belief on."""
    @property
    def vectors(self) -> Optional[list[tuple[str, list[float]]]]:
        """Action and value of each state of each vector."""
    @property
    def cpu_s(self) -> Optional[float]:
        """Processor time that it took, s."""
    @property
    def model(self) -> Model:
        """The model."""

def solve(
    model: Model,
    *,
    precision: float = 0.001,
    timeout_s: Optional[float] = 60.0,
    memory_gib: float = 3.0,
) -> Policy:
    """Finds the best policy, and bounds of what any policy earns."""

def bound(
    model: Model, method: str, *, timeout_s: Optional[float] = 60.0
) -> tuple[Optional[float], Optional[float]]:
    """Bounds the best value by mdp, qmdp, fib, tib, blind or sarsop: lower, upper."""

def heuristic(model: Model, name: str, *, threshold: float = 0.5) -> Policy:
    """A policy without a search: mls, av, qmdp, fib, and dm-X and adm-X of each."""

def compact(policy: Policy, vectors_max: int) -> Policy:
    """The vectors of a solved policy that lose least."""

def value(policy: Policy, *, beliefs_max: int = 20000) -> tuple[float, float]:
    """Bounds of what a policy earns: lower, upper."""

def simulate(
    model: Model,
    policy: Policy,
    *,
    runs: int = 1000,
    steps: Optional[int] = None,
    seed: int = 1,
) -> tuple[float, float]:
    """Mean discounted reward of a run, and half width of its 95 % interval."""
