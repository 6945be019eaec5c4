"""Figures of simulations for files: SVG and PNG, drawn from result documents and tables of columns."""
