"""Coupling algorithms of power bonds, and the stable-step rule.

Derivation and figures: docs/decisions/0004-coupling.md.
"""

from __future__ import annotations

import math
from dataclasses import replace

from hub.participant import BondPlan, Correction
from schemas.ports import BondSide
from schemas.scenario import Bond

__all__ = ["bond_plans", "is_fresh", "stable_step_problem"]

_RULE_SHARE = 0.5
"""With this factor the rules of impulse and impulse-linearised hold in all of 108 linear cases
(`bench/stable_step.py`), the rules of held inputs in half of the cases: only the tool's own damping
dissipates the energy created by held inputs, and the bond does not know this damping.
"""

_ENERGY_SHARE = 0.25
"""A press and release creates 0.13 H^2 k_contact / m of the exchanged energy
(`tests/engines/bullet/press_and_release.py`): 0.8 % with this factor.
"""


def is_fresh(bond: Bond, source_side: str) -> bool:
    """Return whether the opposite side receives the outputs of `source_side` within the same step.

    `source_side` is `motion` or `force`.
    """
    if bond.algorithm in ("impulse", "impulse-linearised"):
        return source_side == "force"
    if bond.algorithm == "gauss-seidel" and bond.order is not None:
        source = bond.motion if source_side == "motion" else bond.force
        return bond.order[0] == source.participant
    return False


def bond_plans(bond: Bond, force: BondSide, step_s: float) -> tuple[BondPlan, BondPlan]:
    """Return the plans of the motion side and the force side; `step_s`: communication step in seconds."""
    if bond.algorithm == "impulse":
        plan = BondPlan(prediction=bond.prediction, mean=True)
        return plan, plan
    if bond.algorithm == "impulse-linearised":
        k, b, mass = _number(force.stiffness), _number(force.damping), _number(force.proxy_mass)
        gain = linearised_gain(step_s, k, b, mass, force.proxy_step)
        plan = BondPlan(prediction="velocity", mean=True)
        return replace(plan, correction=Correction(gain=gain, stiffness=k, damping=b)), plan
    plan = BondPlan(prediction="hold", mean=False)
    return plan, plan


def linearised_gain(
    step_s: float, stiffness: float, damping: float, proxy_mass: float, proxy_step_s: float = 0.0
) -> float:
    """Return g = S / (k H^2/6 + b H/2) with S = m_p [1 - (1 - min(1, b h / m_p)) exp(-(H - h) sqrt(k/m_p))].

    S is the mass reflected by the proxy alone to the tool within a step: small for short steps, all of m_p
    for long steps. An explicit damper adds the share b h / m_p at once, in the first sub-step h of the proxy.
    """
    first = min(proxy_step_s, step_s)
    left = 1.0 - min(1.0, damping * first / proxy_mass)
    reflected = proxy_mass * (1.0 - left * math.exp((first - step_s) * math.sqrt(stiffness / proxy_mass)))
    return reflected / (stiffness * step_s**2 / 6.0 + damping * step_s / 2.0)


def stable_step_problem(bond: Bond, motion: BondSide, force: BondSide, step_s: float) -> str | None:
    """Return how `bond` breaks the stable-step rule at a step of `step_s` seconds, or None.

    The rules:
        impulse: H <= 0.5 m / b.
        impulse-linearised: H <= 0.5 sqrt(m (1/k + 1/k_contact)) and m >= 0.5 m_proxy.
        Both: H <= 0.25 sqrt(m / k_contact), or a press and release creates more than 1 % of the exchanged
        energy (docs/decisions/0015-contact-force.md).
        gauss-seidel and jacobi with held inputs: H <= 0.5 m / b and H <= 0.5 sqrt(m / k), the sampling limits
        of a held damper and a held spring.

    m: effective mass of the motion side; k, b: virtual coupling. Numbers not stated by a side are not
    checked.
    """
    mass = motion.effective_mass
    if mass is None:
        return None
    numbers = {
        "m": mass,
        "k": force.stiffness,
        "b": force.damping,
        "k_contact": force.contact_stiffness,
        "m_proxy": force.proxy_mass,
    }
    known = ", ".join(f"{name} = {value:.4g}" for name, value in numbers.items() if value is not None)
    if bond.algorithm == "impulse-linearised" and mass < _RULE_SHARE * _number(force.proxy_mass):
        return (
            f"the rule m >= 0.5 m_proxy of 'impulse-linearised' is broken ({known} in SI units). "
            "Use a lighter proxy, which a shorter sub-step of the force side allows, or a heavier tool."
        )
    broken = {rule: limit for rule, limit in _step_limits(bond, force, mass).items() if step_s > limit}
    if not broken:
        return None
    rule, limit = min(broken.items(), key=lambda item: item[1])
    return (
        f"a step of {step_s * 1e3:.4g} ms breaks the rule {rule} of '{bond.algorithm}', which allows"
        f" {limit * 1e3:.4g} ms ({known} in SI units). Use a shorter step, a heavier tool, a softer virtual"
        " coupling, or 'impulse-linearised' for a light tool."
    )


def _step_limits(bond: Bond, force: BondSide, mass: float) -> dict[str, float]:
    """Return the longest step (s) allowed by each rule of the bond's algorithm for a tool of `mass` (kg)."""
    stiffness, damping, contact = force.stiffness, force.damping, force.contact_stiffness
    limits: dict[str, float] = {}
    if bond.algorithm == "impulse-linearised":
        if stiffness:
            limits["H <= 0.5 sqrt(m (1/k + 1/k_contact))"] = _RULE_SHARE * math.sqrt(
                mass * (1.0 / stiffness + 1.0 / (contact or stiffness))
            )
    elif damping:
        limits["H <= 0.5 m/b"] = _RULE_SHARE * mass / damping
    if bond.algorithm in ("impulse", "impulse-linearised"):
        if contact:
            limits["H <= 0.25 sqrt(m/k_contact)"] = _ENERGY_SHARE * math.sqrt(mass / contact)
    elif stiffness:
        limits["H <= 0.5 sqrt(m/k)"] = _RULE_SHARE * math.sqrt(mass / stiffness)
    return limits


def _number(value: float | None) -> float:
    return 0.0 if value is None else value
