"""The pages for people: every block is run, every link resolves."""
