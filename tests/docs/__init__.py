"""Tests of the documentation: every block is run, every link resolves."""
