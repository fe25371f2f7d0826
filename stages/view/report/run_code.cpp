#include "stages/view/report/run_code.h"

#include <zlib.h>

#include <algorithm>

namespace lamina::view::report {

namespace {

void add_number(std::uint64_t value, Buffer<std::byte>& code) {
  for (; value > 127; value >>= 7) code.push_back(static_cast<std::byte>(128 | (value & 127)));
  code.push_back(static_cast<std::byte>(value));
}

std::uint64_t folded(std::int64_t value) {
  return value < 0 ? 2 * static_cast<std::uint64_t>(-value) - 1 : 2 * static_cast<std::uint64_t>(value);
}

}  // namespace

Buffer<std::byte> deflate_bytes(std::span<const std::byte> bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  Buffer<std::byte> packed(size);
  compress2(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
            static_cast<uLong>(bytes.size()), Z_BEST_COMPRESSION);
  packed.resize(size);
  return packed;
}

Buffer<std::byte> pack_runs(const RunsView& runs) {
  Buffer<std::byte> code;
  std::span<const std::uint32_t> before;
  std::uint32_t same = 0;
  const auto flush = [&] {
    if (same == 0) return;
    add_number(0, code);
    add_number(same, code);
    same = 0;
  };
  for (std::uint32_t r = 0; r < runs.rows(); ++r) {
    const std::span<const std::uint32_t> row = runs.row(r);
    if (std::ranges::equal(row, before)) {
      ++same;
    } else if (row.size() == before.size()) {
      flush();
      add_number(1, code);
      for (std::size_t i = 0; i < row.size(); ++i) add_number(folded(std::int64_t{row[i]} - before[i]), code);
    } else {
      flush();
      add_number(2 + row.size(), code);
      std::uint32_t column = 0;
      for (const std::uint32_t change : row) {
        add_number(change - column, code);
        column = change;
      }
    }
    before = row;
  }
  flush();
  return deflate_bytes(code);
}

}  // namespace lamina::view::report
