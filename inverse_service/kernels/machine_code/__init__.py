"""Machine code: kept on disk between processes, loaded by LLVM; kernels written as plain Python functions."""
