"""Search for closed-form Lagrangians with ansätze that lead to linear problems, cheapest first."""
