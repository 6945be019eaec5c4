"""The search for closed-form Lagrangians: ansätze that are linear problems, cheapest first."""
