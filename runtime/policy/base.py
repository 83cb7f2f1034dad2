"""What every policy is: a function of the observation that answers with thrust rates."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from twinscrew.runtime.messages.types import Float64, Observation


@runtime_checkable
class Policy(Protocol):
    """A policy: ONNX, APF or MPC."""

    @property
    def name(self) -> str:
        """What the policy calls itself, as "ac_iqn"."""

    @property
    def period_s(self) -> float:
        """[s] Time between two decisions that the policy was made for."""

    def act(self, observation: Observation) -> Float64:
        """Give the thrust rates, (2,) [N/s] left and right, for what is seen.

        Raises
        ------
        PolicyError
            The policy gave anything but two finite numbers.
        """

    def reset(self) -> None:
        """Forget everything remembered of a run."""
