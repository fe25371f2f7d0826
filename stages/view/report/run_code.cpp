#include "stages/view/report/run_code.h"

#include <zlib.h>

#include <algorithm>
#include <utility>

namespace lamina::view::report {

namespace {

void add_number(std::uint64_t value, Buffer<std::byte>& code) {
  for (; value > 127; value >>= 7) code.push_back(static_cast<std::byte>(128 | (value & 127)));
  code.push_back(static_cast<std::byte>(value));
}

std::uint64_t folded(std::int64_t value) {
  return value < 0 ? 2 * static_cast<std::uint64_t>(-value) - 1 : 2 * static_cast<std::uint64_t>(value);
}

/// Deflates bytes as they come, so that they are never in memory all at once.
class Deflater {
 public:
  Deflater() { deflateInit(&stream_, Z_BEST_COMPRESSION); }
  Deflater(const Deflater&) = delete;
  Deflater& operator=(const Deflater&) = delete;
  ~Deflater() { deflateEnd(&stream_); }

  void add(std::span<const std::byte> bytes) { put(bytes, Z_NO_FLUSH); }
  Buffer<std::byte> finish() {
    put({}, Z_FINISH);
    packed_.resize(used_);
    return std::move(packed_);
  }

 private:
  void put(std::span<const std::byte> bytes, int flush) {
    constexpr std::size_t kStep = 1 << 16;
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(bytes.data()));
    stream_.avail_in = static_cast<uInt>(bytes.size());
    int state = Z_OK;
    do {
      if (packed_.size() - used_ < kStep) packed_.resize(used_ + used_ / 4 + kStep);
      stream_.next_out = reinterpret_cast<Bytef*>(packed_.data() + used_);
      stream_.avail_out = static_cast<uInt>(std::min<std::size_t>(packed_.size() - used_, UINT32_MAX));
      const uInt before = stream_.avail_out;
      state = deflate(&stream_, flush);
      used_ += before - stream_.avail_out;
    } while (stream_.avail_in > 0 || (flush == Z_FINISH && state == Z_OK));
  }

  z_stream stream_{};
  Buffer<std::byte> packed_;
  std::size_t used_ = 0;
};

}  // namespace

Buffer<std::byte> deflate_bytes(std::span<const std::byte> bytes) {
  constexpr std::size_t kPiece = 1 << 30;
  Deflater deflater;
  for (; bytes.size() > kPiece; bytes = bytes.subspan(kPiece)) deflater.add(bytes.first(kPiece));
  deflater.add(bytes);
  return deflater.finish();
}

Buffer<std::byte> pack_runs(RowRuns image) {
  constexpr std::size_t kPiece = 1 << 18;
  Deflater deflater;
  Buffer<std::byte> code;
  std::span<const std::uint32_t> before;
  std::uint32_t same = 0;
  const auto flush = [&] {
    if (same == 0) return;
    add_number(0, code);
    add_number(same, code);
    same = 0;
  };
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const std::span<const std::uint32_t> row = image.row(r);
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
    if (code.size() < kPiece) continue;
    deflater.add(code);
    code.clear();
  }
  flush();
  deflater.add(code);
  return deflater.finish();
}

}  // namespace lamina::view::report
