// rank FILE.sms PRIME: the rank of a sparse matrix by LinBox's elimination, and its processor time without reading.
#include <ctime>
#include <fstream>
#include <iostream>
#include <linbox/linbox-config.h>
#include <linbox/matrix/sparse-matrix.h>
#include <linbox/solutions/rank.h>

int main(int, char** arguments) {
  using Field = Givaro::Modular<uint64_t, unsigned __int128>;
  Field field(std::stoull(arguments[2]));
  std::ifstream file(arguments[1]);
  LinBox::MatrixStream<Field> stream(field, file);
  LinBox::SparseMatrix<Field, LinBox::SparseMatrixFormat::SparseSeq> matrix(stream);
  size_t rank = 0;
  const std::clock_t began = std::clock();
  LinBox::rankInPlace(rank, matrix, LinBox::Method::SparseElimination());
  std::cout << rank << " " << double(std::clock() - began) / CLOCKS_PER_SEC << std::endl;
}
