"""The Legendre transform: forms of L whose momenta can be solved for the velocities."""
