"""Random second-order systems: with a known Lagrangian, disguised, and without any structure."""

from tests.generator.disguise import disguised
from tests.generator.right_sides import RandomRightSide, random_right_side, random_right_sides
from tests.generator.systems import GeneratedSystem, random_system, random_systems

__all__ = [
    "GeneratedSystem",
    "RandomRightSide",
    "disguised",
    "random_right_side",
    "random_right_sides",
    "random_system",
    "random_systems",
]
