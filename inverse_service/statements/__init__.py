"""What is asked about a system, what the work on it is at, and in which order people meet what was
found.

`questions` names a question; `reasons` why one is open; `domains` the sets on which statements
hold; `parts` the parts of a result; `stages` those of the work; `order` sorts the statements that
answer questions. All rooms above `expressions` may use them.
"""
