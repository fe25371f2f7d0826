#include "stages/view/report/run_code.h"

#include <zlib.h>

#include <algorithm>
#include <utility>

namespace lamina::view::report {

namespace {

// Lazy matching with short chains: level 9 makes runs a fifth smaller, and takes six times as long.
constexpr int kLevel = 4;
// Movements of an end that share a byte; the byte of two runs that stay, and of so many; of movements that do not share one.
constexpr std::uint64_t kSmall = 15, kStay = 225, kMaxStay = 31, kWide = 255;
constexpr std::size_t kLongest = 11;  // bytes of a run: kWide and two numbers of 33 bits

std::byte* put_number(std::uint64_t value, std::byte* to) {
  for (; value > 127; value >>= 7) *to++ = static_cast<std::byte>(128 | (value & 127));
  *to++ = static_cast<std::byte>(value);
  return to;
}

/// 0 -1 1 -2 2 ... are 0 1 2 3 4 ...
std::uint64_t folded(std::uint32_t now, std::uint32_t before) {
  const std::int64_t value = std::int64_t{now} - before;
  return static_cast<std::uint64_t>(value * 2) ^ static_cast<std::uint64_t>(value >> 63);
}

/// Runs as movements of those of the row before, as many.
std::byte* put_movements(std::span<const std::uint32_t> row, std::span<const std::uint32_t> before, std::byte* to) {
  std::uint64_t stay = 0;
  const auto put_stay = [&] {
    if (stay > 0) *to++ = static_cast<std::byte>(stay == 1 ? 0 : kStay + stay - 2);
    stay = 0;
  };
  for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
    const std::uint64_t begin = folded(row[i], before[i]), end = folded(row[i + 1], before[i + 1]);
    if (begin + end == 0) {
      if (++stay == kMaxStay) put_stay();
      continue;
    }
    put_stay();
    if (begin < kSmall && end < kSmall) {
      *to++ = static_cast<std::byte>(kSmall * begin + end);
      continue;
    }
    *to++ = static_cast<std::byte>(kWide);
    to = put_number(end, put_number(begin, to));
  }
  put_stay();
  return to;
}

}  // namespace

Buffer<std::byte> deflate_bytes(std::span<const std::byte> bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  Buffer<std::byte> packed(size);
  compress2(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
            static_cast<uLong>(bytes.size()), kLevel);
  packed.resize(size);
  return packed;
}

Buffer<std::byte> pack_runs(const RunsView& runs) {
  Buffer<std::byte> code;
  std::size_t size = 0;
  std::span<const std::uint32_t> before;
  std::uint32_t same = 0;
  for (std::uint32_t r = 0; r <= runs.rows(); ++r) {
    const std::span<const std::uint32_t> row = r < runs.rows() ? runs.row(r) : std::span<const std::uint32_t>();
    if (r < runs.rows() && std::ranges::equal(row, before)) {
      ++same;
      continue;
    }
    const std::size_t enough = size + 3 * kLongest + row.size() / 2 * kLongest;
    if (code.size() < enough) code.resize(std::max(enough, 2 * code.size()));
    std::byte* to = code.data() + size;
    if (same > 0) to = put_number(same, put_number(0, to));
    same = 0;
    if (r < runs.rows() && row.size() == before.size()) {
      to = put_movements(row, before, put_number(1, to));
    } else if (r < runs.rows()) {
      to = put_number(2 + row.size(), to);
      std::uint32_t column = 0;
      for (const std::uint32_t change : row) to = put_number(change - std::exchange(column, change), to);
    }
    size = static_cast<std::size_t>(to - code.data());
    before = row;
  }
  return deflate_bytes(std::span(code).first(size));
}

}  // namespace lamina::view::report
