// Where the factor W of a block is kept: a lower triangle in panels of one cache line's columns,
//
//   panel 0   panel 1          panel p holds the rows from its own first column on, each row one
//   [x . . .]                  cache line; what lies on and above W's diagonal is not read
//   [x x . .]
//   [x x x .] [x . . .]
//
// so that both substitutions read it in one direction without a gap.
#pragma once

namespace trajopt::linalg {

template <class T>
struct PackedTriangle {
  static constexpr int kColumns = 64 / static_cast<int>(sizeof(T));  // of a panel

  static constexpr long panels(int size) { return (size + kColumns - 1) / kColumns; }

  // Of the first element of panel p.
  static constexpr long offset(int size, long p) {
    return kColumns * (p * size - kColumns * (p * (p - 1) / 2));
  }
  static constexpr long length(int size) { return offset(size, panels(size)); }

  // Of element (row, column), row >= its panel's first column.
  static constexpr long at(int size, int row, int column) {
    const long p = column / kColumns;
    return offset(size, p) + (row - p * kColumns) * kColumns + column - p * kColumns;
  }
};

}  // namespace trajopt::linalg
