"""Compile kernels written as plain Python functions, keep their machine code on disk, and load it
with LLVM.
"""
